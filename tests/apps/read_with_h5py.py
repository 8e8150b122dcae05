"""Python reads what dofusion-generate writes: every table of the documented layout, with its shape and meaning."""
import json
import subprocess
import sys
import tempfile

import h5py
import numpy as np

with tempfile.TemporaryDirectory() as folder:
    path = folder + "/two.h5"
    subprocess.run([sys.argv[1], "--task", "unstructured", "--objects", "2", "--count", "20", "--seed", "4",
                    "--out", path], check=True)
    with h5py.File(path) as f:
        assert f.attrs["format"] in (b"dofusion-scenes", "dofusion-scenes"), f.attrs["format"]
        assert f.attrs["version"] == 2
        settings = json.loads(f.attrs["settings"])
        assert settings["seed"] == 4
        assert [part["count"] for part in settings["parts"]] == [20]
        shapes = len(f["shapes/name"])
        assert f["shapes/kind"].shape == (shapes,) and set(f["shapes/kind"][:]) <= {0, 1, 2, 3}
        for name, table in (("vertex_start", "vertices"), ("triangle_start", "triangles")):
            assert f["shapes/" + name].shape == (shapes + 1,) and f["shapes/" + name][-1] == len(f["shapes/" + table])
            convex = f["shapes/convex_" + name]
            assert len(convex) == f["shapes/convex_start"][-1] + 1 and convex[-1] == len(f["shapes/convex_" + table])
        assert list(f["scenes/index"][:]) == list(range(20)) and not f["scenes/part"][:].any()
        assert set(f["scenes/task"][:]) == {1} and set(f["scenes/split"][:]) <= {0, 1, 2}
        start = f["scenes/start"][:]
        assert list(start) == list(range(0, 42, 2)), start
        pose, scale, shape = f["objects/pose"][:], f["objects/scale"][:], f["objects/shape"][:]
        assert pose.shape == (40, 7) and scale.shape == (40, 3) and shape.shape == (40,)
        assert np.allclose(np.linalg.norm(pose[:, 3:], axis=1), 1.0)
        assert np.all(f["objects/touches"][:] != 0)
        # The lowest vertex of every object lies on the table or above it.
        for p, s, k in zip(pose, scale, shape):
            first, last = f["shapes/vertex_start"][k], f["shapes/vertex_start"][k + 1]
            v = f["shapes/vertices"][first:last] * s
            w, x, y, z = p[3:]
            third_row = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
            assert (v @ third_row + p[2]).min() > -5e-4
print("ok")
