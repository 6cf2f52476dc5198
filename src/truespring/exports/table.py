"""The table of export targets."""

from collections.abc import Mapping
from types import MappingProxyType

from truespring.exports.abaqus import abaqus
from truespring.exports.arrays import as_json, npz
from truespring.exports.c import c
from truespring.exports.calculix import calculix
from truespring.exports.decks import SPRINGA
from truespring.exports.features import ALL, Feature
from truespring.exports.mujoco import mujoco
from truespring.exports.sofa import sofa
from truespring.exports.target import Target

_DECKS = ("springs.inp", "fem.inp")
_IN_DECKS = "springs.inp has the springs as SPRINGA elements; fem.inp has the same body as finite elements."
_NOT_IN_DECKS = "Density and contact are left out; weight is in the nodal forces."
_ARRAYS = "All springs, elements, constants, supports and loads are arrays; see docs/export/arrays.md."
_NOTHING = "Nothing of the model is left out."
_FOLLOWED = frozenset({Feature.PRESTRESS, Feature.FOLLOWING})

#: Export targets by name.
TARGETS: Mapping[str, Target] = MappingProxyType(
    {
        "calculix": Target(
            calculix,
            "CalculiX decks: springs.inp of SPRINGA elements, fem.inp of finite elements",
            "CalculiX",
            _DECKS,
            SPRINGA,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
        ),
        "abaqus": Target(
            abaqus,
            "the same for Abaqus",
            "Abaqus",
            _DECKS,
            SPRINGA,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
            unrun="Abaqus was not run; CalculiX reads the same keywords",
        ),
        "mujoco": Target(
            mujoco,
            "MuJoCo MJCF: springs.xml of bodies on slide joints and spatial tendons",
            "MuJoCo",
            ("springs.xml",),
            _FOLLOWED,
            expressed="Nodes are bodies on slide joints, springs are spatial tendons, loads are actuators.",
            left_out="The body has no surface and no contact.",
        ),
        "sofa": Target(
            sofa,
            "a Python scene for SOFA, of springs and finite elements; experimental",
            "SOFA",
            ("springs_scene.py",),
            _FOLLOWED | {Feature.NEGATIVE},
            expressed="Springs are a MeshSpringForceField, finite elements a node of their own, loads constant forces.",
            left_out="Contact is not set up.",
            unrun="SOFA was not run; the scene is checked against the source code of SOFA",
        ),
        "c": Target(
            c,
            "a runtime in C99: truespring.h moves the body of body.bin, main.c settles it",
            "the C runtime",
            ("truespring.h", "body.bin", "main.c"),
            ALL,
            expressed="body.bin has springs, elements, masses, supports and dead loads; truespring.h moves them.",
            left_out="Contact is with spheres only, without friction; the body does not touch itself.",
        ),
        "npz": Target(npz, "NumPy arrays: springs.npz", "npz", ("springs.npz",), ALL, _ARRAYS, _NOTHING),
        "json": Target(
            as_json, "the same arrays as text: springs.json", "json", ("springs.json",), ALL, _ARRAYS, _NOTHING
        ),
    }
)
