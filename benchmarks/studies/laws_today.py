"""Have the laws of the gripper study changed since it was published? python -m benchmarks.studies.laws_today [SEARCH]

The module of a published winner is solved by today's FEM; today's law of the meta-model is compared with it as the
check of the search did, and the figures with those in docs/studies/gripper_codesign.json.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

from benchmarks.output import ROOT, make_parser
from benchmarks.studies.gripper_codesign import ASKED, ROBUST
from benchmarks.studies.page import DOCS

from pliant.pipeline.study import build_study_laws
from pliant_search.evaluate.evaluator import build_search_problem
from pliant_search.verify.direct_fem import direct_studies
from pliant_search.verify.verification import law_errors

KEYS = (
    "n_states",
    "largest_effort",
    "rmse_of_range",
    "worst_of_range",
    "rmse_of_largest",
    "worst_of_largest",
)
STORE = ROOT / ".pliant" / "store"


def main(args: Sequence[str] | None = None) -> None:
    parser = make_parser(__doc__)
    names = [one.name for one in (*ASKED, ROBUST)]
    parser.add_argument("search", nargs="?", default="optuna", choices=names, help="whose winner is solved")
    name = parser.parse_args(args).search
    asked = next(one for one in (*ASKED, ROBUST) if one.name == name)
    run = json.loads((DOCS / "gripper_codesign.json").read_text(encoding="utf-8"))["runs"][name]
    opened = asked.opened(STORE, quiet=True)
    winner = build_search_problem(opened.context, opened.study).apply(run["best"]["values"], 0)
    (solved,), _ = direct_studies(opened.context, [winner])
    (searched,), (direct,) = (build_study_laws(opened.context, one) for one in (winner, solved))
    assert direct.fem is not None
    today, published = law_errors(searched.law.law, direct.fem.value), run["verified"]["laws"][0]
    print(f"{name}: {published['name']}")
    for key in KEYS:
        print(f"  {key:<17} published {published[key]:.8g}  today {today[key]:.8g}")
    apart = abs(today["worst_of_range"] - published["worst_of_range"])
    print(f"  the worst error of the law differs by {100 * apart:.2g} % of its range")


if __name__ == "__main__":
    main()
