"""The scripts of examples/python run, and what they write holds."""
import os
import subprocess
import sys
import xml.dom.minidom

import made
import numpy as np

examples = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../examples/python")


class Examples(made.Case):
    def run_example(self, name, *arguments):
        done = subprocess.run([sys.executable, os.path.join(examples, name), *map(str, arguments)], cwd=self.folder,
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_prt_features(self):
        self.assertIn("4642 vertices", self.run_example("prt_features.py"))
        prt = np.loadtxt(self.path("out/prt/bounce/bounce0.txt"))
        self.assertEqual(prt.shape, (4642, 9))
        self.assertEqual(np.load(self.path("out/prt/env_sh.npy")).shape, (2, 9, 3))
        v, f = made.cube(3)
        made.write_obj(self.path("c.obj"), v, f)
        self.run_example("prt_features.py", "c.obj", "c")
        self.assertEqual(np.loadtxt(self.path("c/bounce/bounce0.txt")).shape, (len(v), 9))
        faces = np.load(self.path("c/bounce/face.npy"))
        self.assertEqual({frozenset(t) for t in faces.tolist()}, {frozenset(t) for t in f.tolist()})

    def test_sky_video(self):
        self.run_example("sky_video.py", self.room(), "video", 3)
        light = np.load(self.path("video/light.npy"))
        self.assertEqual((light.shape[1:], light.dtype), ((3, 3), np.float32))
        self.assertGreater(light[:, 1].mean(), light[:, 0].mean())  # noon, morning
        for i in range(3):
            with open(self.path(f"video/frame_{i:03}.png"), "rb") as f:
                self.assertEqual(f.read(8), b"\x89PNG\r\n\x1a\n")

    def test_error_study(self):
        lines = self.run_example("error_study.py", self.room(), "e.svg", 64).splitlines()
        errors = [float(line.split()[2]) for line in lines if line.endswith("%")]
        self.assertEqual(len(errors), 3)
        self.assertTrue(errors[0] > errors[1] > errors[2] > 0)
        xml.dom.minidom.parse(self.path("e.svg"))


if __name__ == "__main__":
    made.unittest.main()
