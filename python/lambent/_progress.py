"""Progress: any callable (stage, fraction), or True for a bar."""
import sys


class Bar:
    """tqdm's bar where that is installed (in notebooks its widget), else a line that is drawn over itself."""

    def __init__(self):
        try:
            from tqdm.auto import tqdm
        except ImportError:
            tqdm = None
        self.tqdm, self.bar, self.stage = tqdm, None, None

    def __call__(self, stage, fraction):
        if self.tqdm is None:
            end = "\n" if fraction >= 1 and self.stage is not None else ""
            print(f"\r{stage}: {100 * fraction:3.0f} %{end}", end="", file=sys.stderr, flush=True)
            self.stage = None if end else stage
            return
        if stage != self.stage:
            self.close()
            self.bar, self.stage = self.tqdm(total=100, desc=stage, unit="%"), stage
        self.bar.n = round(100 * fraction)
        self.bar.refresh()

    def close(self):
        """Ends the bar or the line."""
        if self.bar is not None:
            self.bar.close()
        elif self.tqdm is None and self.stage is not None:
            print(file=sys.stderr)
        self.bar = self.stage = None


class reporting:
    """`with reporting(progress) as report`: a callable for the work, or None."""

    def __init__(self, progress):
        if progress is not None and not isinstance(progress, bool) and not callable(progress):
            raise TypeError("progress must be None, True, False or a callable (stage, fraction)")
        self.bar = Bar() if progress is True else None
        self.report = self.bar or (progress if callable(progress) else None)

    def __enter__(self):
        return self.report

    def __exit__(self, *exception):
        if self.bar:
            self.bar.close()
