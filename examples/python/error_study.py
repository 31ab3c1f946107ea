"""How the error of a bake falls with its rays, as a plot: by matplotlib where that is installed, else as plain SVG.
    error_study.py [SCENE] [PLOT.svg|.png]      a made pavilion where no scene is given
"""
import sys

import lambent
import numpy as np
from sky_video import made_pavilion


def study(scene, samples, truth):
    """RMS error of the transfer vectors, relative, for each number of rays, against a bake of `truth` rays."""
    def values(n, seed):
        return lambent.bake(scene, samples=n, seed=seed, order=4, precision="single").values
    exact = values(truth, 7)
    norm = np.sqrt((exact**2).sum())
    return [float(np.sqrt(((values(n, 1) - exact)**2).sum()) / norm) for n in samples]


def plot_svg(path, x, y, title):
    """Both axes logarithmic, with a line of slope -1/2."""
    def place(a, b):
        u = (np.log10(a) - np.log10(x[0])) / (np.log10(x[-1]) - np.log10(x[0]))
        low, high = np.floor(np.log10(min(y))), np.ceil(np.log10(max(y)))
        return 60 + 400 * u, 260 - 220 * (np.log10(b) - low) / (high - low)
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" width="500" height="310" font-family="sans-serif" '
             'font-size="12">', '<rect width="500" height="310" fill="white"/>', f'<text x="60" y="24">{title}</text>']
    for n in x:
        u, _ = place(n, y[0])
        parts.append(f'<text x="{u:.1f}" y="280" text-anchor="middle">{n}</text>')
    for power in range(int(np.floor(np.log10(min(y)))), int(np.ceil(np.log10(max(y)))) + 1):
        _, v = place(x[0], 10.0**power)
        parts.append(f'<path d="M60 {v:.1f}H460" stroke="#ccc"/>')
        parts.append(f'<text x="52" y="{v + 4:.1f}" text-anchor="end">1e{power}</text>')
    for values, style in ((y, 'stroke="#06c" stroke-width="2"'),
                          ([y[0] * (x[0] / n)**0.5 for n in x], 'stroke="#999" stroke-dasharray="4 4"')):
        points = " ".join(f"{u:.1f},{v:.1f}" for u, v in (place(n, e) for n, e in zip(x, values)))
        parts.append(f'<polyline points="{points}" fill="none" {style}/>')
    parts.append('<text x="260" y="300" text-anchor="middle">rays a receiver (dashed: 1/sqrt)</text></svg>')
    with open(path, "w", encoding="utf-8") as out:
        out.write("\n".join(parts) + "\n")


def main(scene=None, path="error.svg", most=1024):
    scene = lambent.load(scene) if scene else made_pavilion(10)
    samples = [n for n in (16, 32, 64, 128, 256, 512, 1024) if n <= int(most)]
    errors = study(scene, samples, 8 * samples[-1])
    for n, e in zip(samples, errors):
        print(f"{n:5} rays  {100 * e:.3f} %")
    title = "Relative RMS error of transfer, order 4, 3 bounces"
    try:
        import matplotlib
    except ImportError:
        if not path.endswith(".svg"):
            sys.exit("without matplotlib the plot is an .svg")
        plot_svg(path, samples, errors, title)
    else:
        matplotlib.use("Agg")
        from matplotlib import pyplot
        pyplot.loglog(samples, errors, "o-", samples, [errors[0] * (samples[0] / n)**0.5 for n in samples], "--")
        pyplot.title(title), pyplot.xlabel("rays a receiver"), pyplot.savefig(path)
    print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
