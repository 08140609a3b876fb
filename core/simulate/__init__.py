"""Simulated walkers and sensors with exact truth, for tests, demo and CLI (docs/simulation.md)."""

from core.simulate.magnetics import Dipole
from core.simulate.mems import SensorNoise
from core.simulate.mt_text import mt_files, mt_text
from core.simulate.patients import PATIENTS, Patient
from core.simulate.script import Arc, Pivot, Script, Stand, Steps, Straight
from core.simulate.scripts import SCRIPTS, Scenario, simulate_scenario
from core.simulate.setup import Dropout, Setup
from core.simulate.simulation import Simulation, simulate
from core.simulate.soft_tissue import SoftTissue
from core.simulate.tables import angle_table, event_table, stride_table
from core.simulate.truth import Truth
from core.simulate.walker import STEADY, SideGait, Variability, Walker

__all__ = [
    "PATIENTS",
    "SCRIPTS",
    "STEADY",
    "Arc",
    "Dipole",
    "Dropout",
    "Patient",
    "Pivot",
    "Scenario",
    "Script",
    "SensorNoise",
    "Setup",
    "SideGait",
    "Simulation",
    "SoftTissue",
    "Stand",
    "Steps",
    "Straight",
    "Truth",
    "Variability",
    "Walker",
    "angle_table",
    "event_table",
    "mt_files",
    "mt_text",
    "simulate",
    "simulate_scenario",
    "stride_table",
]
