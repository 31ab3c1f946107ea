"""Bad arrays, threads, Ctrl-C and the interpreter's end."""
import signal
import subprocess
import sys
import threading
import time

import lambent
import made
import numpy as np


class BadArrays(made.Case):
    def test_refused(self):
        v, f = made.sphere(1)
        nan, far = v.copy(), v.copy()
        nan[3, 1], far[2, 0] = np.nan, 2e9
        cases = [
            ({"vertices": v[:, :2]}, r"vertices: must have the shape \(n, 3\), not"),
            ({"vertices": v.ravel()}, "vertices: must have the shape"),
            ({"vertices": v.astype(complex)}, "vertices: must hold real numbers, not complex128"),
            ({"vertices": v.astype(str)}, "vertices: must hold real numbers"),
            ({"vertices": v.astype(object)}, "vertices: must hold real numbers, not object"),
            ({"vertices": v > 0}, "vertices: must hold real numbers, not bool"),
            ({"vertices": None}, "vertices: must have the shape"),
            ({"vertices": [[1, 2, 3], [4, 5]]}, "vertices: "),
            ({"vertices": nan}, r"vertices\[3\]: is not finite"),
            ({"vertices": far}, r"vertices\[2\]: is not finite or lies beyond 1e9"),
            ({"vertices": np.broadcast_to(np.zeros(3), (2**31, 3))}, "vertices: has 2147483648 rows"),
            ({"vertices": v[:0]}, r"faces\[0\]: names vertex"),
            ({"faces": f.astype(float)}, "faces: must hold whole numbers, not float64"),
            ({"faces": f[:, :2]}, "faces: must have the shape"),
            ({"faces": np.array([[0, 1, len(v)]])}, rf"faces\[0\]: names vertex {len(v)} of {len(v)}"),
            ({"faces": np.array([[0, 1, 2], [0, -1, 2]])}, r"faces\[1\]: names vertex -1"),
            ({"faces": np.broadcast_to(np.arange(3), (2**31, 3))}, "faces: has 2147483648 rows"),
            ({"faces": f[:0]}, "arrays: no triangles"),
            ({"faces": np.array([[0, 0, 1]])}, "arrays: no triangles"),
            ({"vertices": v * 0}, "arrays: no triangle has an area"),
            ({"colors": v[:3] * 0}, "colors: has 3 rows where there are"),
            ({"colors": np.full_like(v, 1.5)}, r"colors\[0\]: is no albedo"),
            ({"colors": nan}, r"colors\[3\]: is not finite"),
            ({"normals": v[1:]}, "normals: has"),
            ({"texcoords": v}, r"texcoords: must have the shape \(n, 2\)"),
        ]
        for change, message in cases:
            with self.subTest(message=message), self.assertRaisesRegex(lambent.Error, "^" + message) as raised:
                lambent.Scene(**{"vertices": v, "faces": f, **change})
            self.assertNotIn("\n", str(raised.exception))

    def test_any_memory(self):
        v, f = made.sphere(1)
        plain = lambent.Scene(v, f)
        read_only = v.copy()
        read_only.setflags(write=False)
        wide = np.zeros((len(v), 7))
        wide[:, 1:7:2] = v
        records = np.zeros(len(v), [("n", "f4", 3), ("p", "f8", 3)])
        records["p"] = v
        unaligned = np.zeros(v.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(v.shape)
        unaligned[:] = v
        for vertices in (read_only, np.asfortranarray(v), wide[:, 1:7:2], v[::-1][::-1], v.astype(">f8"), records["p"],
                         v.tolist(), unaligned, np.ma.array(v), memoryview(v)):
            np.testing.assert_array_equal(lambent.Scene(vertices, f).vertices, plain.vertices)
        for faces in (np.asfortranarray(f), f.astype(np.uint16), f.astype(">i4"), f.astype(np.int8), f.tolist(),
                      np.repeat(f, 2, axis=1)[:, ::2]):
            np.testing.assert_array_equal(lambent.Scene(v, faces).faces, plain.faces)
        half = lambent.Scene(v.astype(np.float16), f)
        np.testing.assert_array_equal(half.vertices, v.astype(np.float16).astype(np.float32))
        before = plain.vertices.copy()
        v[:] = 0  # what was given may change
        np.testing.assert_array_equal(plain.vertices, before)

    def test_options(self):
        scene = lambent.Scene(*made.sphere(1))
        cases = [({"order": "six"}, "order: expects a number"), ({"ground": 1}, "ground: expects true or false"),
                 ({"samples": 1.5}, "samples: expects a whole number"), ({"samples": float("nan")}, "options: "),
                 ({"seed": object()}, "options: "), ({"samples": -3}, "samples: expects a whole number")]
        for options, message in cases:
            with self.subTest(options=options), self.assertRaisesRegex(lambent.Error, "^" + message):
                lambent.bake(scene, **options)
        with self.assertRaises(TypeError):
            lambent.bake(scene, progress=3)
        baked = lambent.bake(scene, samples=8)
        for name in ("output", "exposure", "tone", "baked"):
            with self.assertRaisesRegex(lambent.Error, f"^{name}: is said when"):
                baked.render("uniform:1", **{name: "x"})
        for wrong in (np.zeros((4, 4, 2)), np.zeros((4, 4)), np.full((2, 4, 3), "a")):
            with self.assertRaises(lambent.Error):
                lambent.Image(wrong)
        with self.assertRaises(lambent.Error):
            lambent.environment(np.zeros((5, 4, 3)))
        with self.assertRaises(lambent.Error):
            baked.by_input_vertex(np.zeros(3))


SLOW = """
import lambent, made, sys, threading, time
scene = lambent.Scene(*made.bowl(6))
slow = {"samples": 1 << 17, "order": 1, "bounces": 0}
"""


class Threads(made.Case):
    def test_one_scene_two_threads(self):
        scene = lambent.Scene(*made.bowl(3))
        expected = lambent.bake(scene, samples=64).values
        light = lambent.environment("uniform:1").project(6)
        baked, results = lambent.bake(scene, samples=64), [None] * 4
        lit = baked.relight(light)

        def work(i):
            mine = lambent.bake(scene, samples=64)
            for _ in range(20):
                np.testing.assert_array_equal(baked.relight(light), lit)
            results[i] = mine.values
        threads = [threading.Thread(target=work, args=(i,)) for i in range(len(results))]
        for t in threads:
            t.start()
        for t in threads:
            t.join()
        for r in results:
            np.testing.assert_array_equal(r, expected)

    def test_lock_is_released(self):
        scene, ticks, stop = lambent.Scene(*made.bowl(5)), [0], threading.Event()

        def tick():
            while not stop.is_set():
                ticks[0] += 1
                time.sleep(0.002)
        thread = threading.Thread(target=tick)
        thread.start()
        start = time.monotonic()
        lambent.bake(scene, samples=1024)
        seconds = time.monotonic() - start
        stop.set()
        thread.join()
        self.assertGreater(ticks[0], 20 * min(1, seconds))

    def test_progress(self):
        scene, told = lambent.Scene(*made.bowl(4)), []
        lambent.bake(scene, samples=512, progress=lambda stage, fraction: told.append((stage, fraction)))
        self.assertTrue(told and all(isinstance(s, str) and 0 <= x <= 1 for s, x in told))
        self.assertEqual({threading.current_thread()}, {threading.main_thread()})

        def stop(stage, fraction):
            raise KeyError(stage)
        with self.assertRaises(KeyError):
            lambent.bake(lambent.Scene(*made.bowl(5)), samples=4096, progress=stop)
        lambent.bake(scene, samples=8)  # and all goes on

    def test_interrupt(self):
        code = SLOW + ("import os\n"
                       "threading.Thread(target=lambda: (time.sleep(0.5), os.kill(os.getpid(), 2))).start()\n"
                       "start = time.monotonic()\ntry:\n  lambent.bake(scene, **slow)\n"
                       "except KeyboardInterrupt:\n  print('stopped', time.monotonic() - start)\n"
                       "print(lambent.bake(scene, samples=1, bounces=0).receivers)\n")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        word, seconds = done.stdout.split()[:2]
        self.assertEqual(word, "stopped")
        self.assertLess(float(seconds), 30)  # of minutes

    def test_interpreter_ends_during_a_bake(self):
        code = SLOW + ("for _ in range(2):\n"
                       "  threading.Thread(target=lambda: lambent.bake(scene, **slow), daemon=True).start()\n"
                       "time.sleep(0.7)\nprint('bye')\n")
        start = time.monotonic()
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100, check=False)
        self.assertEqual((done.returncode, done.stdout), (0, "bye\n"), done.stderr)
        self.assertLess(time.monotonic() - start, 60)
        self.assertNotIn("terminate", done.stderr)

    def test_interpreter_ends_while_relighting(self):
        code = SLOW + ("baked = lambent.bake(scene, samples=4)\nlight = baked.project('uniform:1')\n"
                       "def work():\n  while True: baked.relight(light)\n"
                       "for _ in range(3): threading.Thread(target=work, daemon=True).start()\ntime.sleep(0.3)\n")
        for _ in range(3):
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100,
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_terminated(self):
        child = subprocess.Popen([sys.executable, "-c", SLOW + "lambent.bake(scene, **slow)"])
        time.sleep(2)
        child.send_signal(signal.SIGTERM)
        self.assertEqual(child.wait(60), -signal.SIGTERM)


if __name__ == "__main__":
    made.unittest.main()
