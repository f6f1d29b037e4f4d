"""Draw docs/pictures/hold_and_turn.png: the hand of examples/hold_and_turn in one stroke, from above and aside.

Run: python docs/figures/turning.py
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pliant.api import open_study
from pliant.interfaces.effect import Model
from pliant.pipeline.motion import drawn_chain, prepared_chain, with_surfaces
from pliant.pipeline.simulate import scene_engine
from pliant.pipeline.study import StudyRun, build_study_laws
from pliant_view.mujoco.drawing import SceneDrawing
from pliant_view.mujoco.painter import Painter

ROOT = Path(__file__).parents[2]
OUT = ROOT / "docs" / "pictures" / "hold_and_turn.png"
TIMES_S = {"held": 1.5, "turned": 2.5, "let go": 2.8, "swung back": 3.4}
SIZE = (420, 400)


def main() -> None:
    opened = open_study(ROOT / "examples" / "hold_and_turn" / "hand.yaml", store=Path(".pliant/store"))
    chain, backend, task = prepared_chain(opened.context, opened.study)
    frames = task.run(chain, scene_engine(backend, Model(chain))).frames
    looks = drawn_chain(
        opened.context, StudyRun(opened.study, build_study_laws(opened.context, opened.study))
    )
    drawing = SceneDrawing(with_surfaces(task.scene(chain), looks), frames, SIZE)
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    for row, view in zip(figure.subplots(2, len(TIMES_S)), ("iso", "top"), strict=True):
        painter = Painter(drawing, SIZE, view)
        for ax, (label, time_s) in zip(row, TIMES_S.items(), strict=True):
            ax.imshow(painter.picture(frames, int(abs(frames.time_s - time_s).argmin())))
            ax.set_axis_off()
            if view == "iso":
                ax.set_title(label)
        painter.close()
    figure.savefig(OUT, dpi=110)


if __name__ == "__main__":
    main()
