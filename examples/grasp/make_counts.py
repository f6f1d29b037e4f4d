"""Makes counts.csv: three sets of ten trials per condition of our own gripper with a hidden friction of 1.0.

python examples/grasp/make_counts.py     other random numbers than the study's; a minute
"""

from __future__ import annotations

from pathlib import Path

from pliant import api
from pliant_counts.task_keys import changed_task
from pliant_counts.trials import Setting, simulate_trials

HERE = Path(__file__).parent
HIDDEN_FRICTION = 1.0
CONDITIONS = (("cylinder", 15, 2), ("cylinder", 15, 3), ("egg", 13, 5), ("egg", 13, 7), ("egg", 13, 8))
SETS, TRIALS, SEED = 3, 10, 4711
HEADER = """\
# Made by make_counts.py: Pliant's own gripper with a friction of 1.0 instead of the study's 0.8. No bench was asked.
run,object,pressure_kpa,extra_weights,successes,trials
"""


def main() -> None:
    """Simulate the truth and write the file."""
    opened = api.open_study(HERE / "counts.yaml")
    task = opened.study.noisy_task()
    lines = []
    for item, kpa, weights in CONDITIONS:
        for number in range(SETS):
            truth = {
                "task.object": item,
                "task.pressure_pa": 1e3 * kpa,
                "task.extra_weights": weights,
                "task.friction": HIDDEN_FRICTION,
                "task.trials": TRIALS,
                "task.seed": SEED + number,
            }
            setting = Setting(changed_task(task, truth), opened.study.effects)
            successes, trials = simulate_trials(opened.context, opened.study, [setting])[0]
            lines.append(f"set {number + 1},{item},{kpa},{weights},{successes},{trials}\n")
    (HERE / "counts.csv").write_text(HEADER + "".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
