#!/usr/bin/env bash
# Installs packages, builds everything with warnings as errors, runs all tests, and fuzzes the readers of files.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
bash apps/install_packages.sh
cmake --preset ci >/dev/null
cmake --build --preset ci
ctest --preset ci -j "$(nproc)" --timeout 900
# The readers of files against a fuzzer, a minute each: tests/fuzz.
cmake -S . -B build/fuzz -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
  -DDOFUSION_FUZZ=ON -DDOFUSION_WERROR=ON >/dev/null
cmake --build build/fuzz
ctest --test-dir build/fuzz --output-on-failure -j "$(nproc)"
