#!/usr/bin/env bash
# From a fresh Debian 12 machine to placements: installs packages, builds, and runs the main job on a shipped scan.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
bash apps/install_packages.sh
cmake --preset release >/dev/null
cmake --build --preset release --target dofusion-place
./build/release/bin/dofusion-place --depth assets/scans/two_blocks/depth.png \
  --camera assets/scans/two_blocks/camera.json --objects assets/blocks --query hat --out out/demo
echo "also there: out/demo/placements.json, out/demo/scene.xml (for MuJoCo), out/demo/scene.glb (for any 3D viewer), out/demo/segmentation.png"
