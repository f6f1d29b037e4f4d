"""Springs with the stand-in meta-model, for tests: solved designs, and a study of an unsolved one."""

from itertools import product
from pathlib import Path

import numpy as np
from tests.pliant_designs.sweep_bench import PLUGIN, study

from pliant import api

META_PLUGIN = Path(__file__).parent / "meta_plugin.py"
SWEEP = "{radius: [4 mm, 5 mm], length: [8 mm, 9 mm]}"
RADII, LENGTHS = (4e-3, 4.5e-3, 5e-3, 5.5e-3), (8e-3, 9e-3, 10e-3)
UNSEEN = f"""\
pliant: 1
name: unseen
plugins: ['{PLUGIN}', '{META_PLUGIN}']
family: {{kind: springs, radius: 4.7 mm, length: 8.6 mm}}
material: {{kind: neo_hookean, shear_modulus: 240 kPa}}
meta_model: {{kind: stand_in, data: TABLE}}
chain: {{modules: 2, gravity: [0, 0, 0]}}
physics: quasistatic
task: {{kind: free_bending, pressure: 10 kPa}}
"""


def solved(folder, sweep=SWEEP):
    """Return a sweep of springs, solved in this process."""
    return api.sweep(api.open_study(study(folder, sweep), store=folder / "store"), workers=1)


def springs_law(radius_m, length_m):
    """Return k, c, d of τ = k p − c u − d u² (springs_plugin.py)."""
    return 2e-6 * (radius_m / 5e-3) ** 2, 0.05 * (radius_m / 5e-3) ** 3, 0.02 * length_m / 0.01


def free_angle(radius_m, length_m, p):
    """Return the angle at which the spring has no effort."""
    k, c, d = springs_law(radius_m, length_m)
    return (-c + np.sqrt(c * c + 4 * d * k * p)) / (2 * d)


def table(folder, radii=RADII, lengths=LENGTHS):
    """Return a table of springs as a sweep writes it, by the formula."""
    rows = ["pressure_pa,angle_rad,moment_n_m,branch,role,radius_m,length_m,design"]
    for number, (r, length) in enumerate(product(radii, lengths)):
        k, c, d = springs_law(r, length)
        most = free_angle(r, length, 15e3)
        for p in (0.0, 5e3, 10e3, 15e3):
            rows.append(f"{p},{free_angle(r, length, p)!r},0,free,fit,{r},{length},{number}")
            for u in np.array([-0.5, 0.3, 1.2]) * most:
                role = "check" if p == 10e3 else "fit"
                rows.append(
                    f"{p},{u!r},{k * p - c * u - d * u * u!r},constrained,{role},{r},{length},{number}"
                )
    path = folder / "fem.csv"
    path.write_text("\n".join(rows).replace("np.float64(", "").replace(")", "") + "\n")
    return path


def unseen(folder, *changes, data=None):
    """Return the path of a study of an unseen design; `changes` are pairs of texts to replace."""
    text = UNSEEN.replace("TABLE", str(data or table(folder)))
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "unseen.yaml"
    path.write_text(text)
    return path


def opened(folder, *changes, data=None, overrides=()):
    """Write a study of an unseen design and open it."""
    return api.open_study(unseen(folder, *changes, data=data), overrides, store=folder / "store")
