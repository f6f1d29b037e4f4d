"""Task: what the robot is asked to do."""

from __future__ import annotations

from abc import ABC, abstractmethod

from pliant.interfaces.base import ComponentConfig
from pliant.interfaces.physics import Simulation
from pliant.records.chain import ChainModel
from pliant.records.rollout import TaskResult


class TaskConfig(ComponentConfig):
    """Base of a task's config: actuation and loads."""


class Task(ABC):
    """The simulate stage calls `prepare`, has the engine build what it returns, then calls `run`."""

    def __init__(self, config: TaskConfig) -> None:
        self.config = config

    def prepare(self, chain: ChainModel) -> ChainModel:
        """The chain with the task's own gravity, payload or base; loads of the task win over the chain's."""
        return chain

    @abstractmethod
    def run(self, simulation: Simulation) -> TaskResult:
        """Drive the simulation and measure it. Metrics are SI with the unit in the name."""
