"""The environments' names. The engines are imported by `gymnasium.make` only."""

from __future__ import annotations

HERE = "pliant_plugins.envs"
ENVIRONMENTS = {
    "pliant/FreeBending-v0": f"{HERE}.chain_env:FreeBendingEnv",
    "pliant/TipLoad-v0": f"{HERE}.chain_env:TipLoadEnv",
    "pliant/HelicalHang-v0": f"{HERE}.chain_env:HelicalHangEnv",
    "pliant/TendonFinger-v0": f"{HERE}.chain_env:TendonFingerEnv",
    "pliant/FollowShape-v0": f"{HERE}.chain_env:FollowShapeEnv",
    "pliant/Reach-v0": f"{HERE}.control:MeasuredReachEnv",
    "pliant/Track-v0": f"{HERE}.control:MeasuredTrackEnv",
    "pliant/Grasp-v0": f"{HERE}.grasp:GraspEnv",
    "pliant/HoldAndTurn-v0": f"{HERE}.hold_and_turn:HoldAndTurnEnv",
    "pliant/Push-v0": f"{HERE}.push:PushEnv",
    "pliant/ReachAround-v0": f"{HERE}.reach_around:ReachAroundEnv",
    "pliant/Crawl-v0": f"{HERE}.crawl:CrawlEnv",
}
# Needs a study with a search, and is no robot that moves.
DESIGN = {"pliant/Design-v0": "pliant_ppo.design_env:DesignEnv"}


def register() -> None:
    """Register the environments with gymnasium; repeated calls have no effect.

    Raises:
        MissingDependencyError: gymnasium is not installed.
    """
    try:
        import gymnasium
    except ImportError:
        # At the top it would import `pliant`, which imports this module again before its end.
        from pliant.errors import MissingDependencyError

        raise MissingDependencyError("the environments need gymnasium: pip install 'pliant[gym]'.") from None
    for name, place in {**ENVIRONMENTS, **DESIGN}.items():
        if name not in gymnasium.registry:
            gymnasium.register(id=name, entry_point=place)
