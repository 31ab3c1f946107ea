"""The baker as a process: started, watched, stopped; its progress is read as it says it."""
import json
import os
import queue
import shutil
import signal
import subprocess
import threading

import bpy


class Failed(Exception):
    """One line to show."""


def tool_path():
    """The `lambent` to run: of the preferences, of $LAMBENT, or found on the path."""
    addon = bpy.context.preferences.addons.get(__package__)
    given = getattr(addon.preferences, "tool", "") if addon and addon.preferences else ""
    path = bpy.path.abspath(given) or os.environ.get("LAMBENT", "") or shutil.which("lambent") or ""
    if not path or not os.access(path, os.X_OK):
        raise Failed("the program `lambent` was not found: install it, or say where it is in the add-on's preferences")
    return path


class Run:
    """One command. `poll()` until it is no longer None: the exit code; `stage` and `fraction` say how far it is."""

    def __init__(self, arguments):
        self.stage, self.fraction, self.messages, self.lines = "starting", 0.0, [], queue.Queue()
        self.process = subprocess.Popen([tool_path(), *arguments, "--json", "--progress", "json"],
                                        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        text=True, encoding="utf-8", errors="replace")
        self.output = []
        self.readers = [threading.Thread(target=self.read, args=(stream, into), daemon=True) for stream, into in
                        ((self.process.stderr, self.lines.put), (self.process.stdout, self.output.append))]
        for reader in self.readers:
            reader.start()

    @staticmethod
    def read(stream, into):
        for line in stream:
            into(line)
        stream.close()

    def poll(self):
        code = self.process.poll()
        if code is not None:
            for reader in self.readers:
                reader.join(5)
        while not self.lines.empty():
            line = self.lines.get().strip()
            try:
                said = json.loads(line)
                self.stage, self.fraction = said["stage"], said["fraction"]
            except (ValueError, KeyError, TypeError):
                if line:
                    self.messages.append(line)
        return code

    def wait(self, tell=None):
        while self.process.poll() is None:
            try:
                self.process.wait(0.2)
            except subprocess.TimeoutExpired:
                pass
            self.poll()
            if tell:
                tell(self.stage, self.fraction)
        return self.poll()

    def cancel(self):
        """The baker removes what it had begun."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM if os.name == "nt" else signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def result(self):
        """What it printed; raises its own line where it failed."""
        if self.poll() != 0:
            said = [m for m in self.messages if m.startswith("lambent:")] or self.messages or ["it said nothing"]
            raise Failed(said[-1].removeprefix("lambent:").strip())
        return json.loads("".join(self.output) or "{}")
