"""The table of export targets."""

from types import MappingProxyType

from truespring.exports.abaqus import abaqus, abaqus_values
from truespring.exports.arrays import as_json, npz
from truespring.exports.c import c
from truespring.exports.calculix import calculix, calculix_values
from truespring.exports.features import ALL, Feature
from truespring.exports.febio import febio
from truespring.exports.gltf import gltf
from truespring.exports.keyword_files import DECKS, NAMES
from truespring.exports.mujoco import mujoco, mujoco_values
from truespring.exports.obj import obj
from truespring.exports.sofa import sofa
from truespring.exports.target import Option, Target
from truespring.exports.usd import usd
from truespring.exports.warp import warp
from truespring.plugins import Table

_IN_DECKS = "springs.inp has the springs as SPRINGA elements; fem.inp has the same body as finite elements."
_NOT_IN_DECKS = "Density and contact are left out; weight is in the nodal forces."
_ARRAYS = "All springs, elements, constants, supports and loads are arrays; see docs/export/arrays.md."
_NOTHING = "Nothing of the model is left out."
_SHAPES = "The surface at rest and at the load levels, in metres and float32."
_NO_SPRINGS = "Springs, supports and loads are left out: the files are for viewing."
_FOLLOWED = frozenset({Feature.PRESTRESS, Feature.FOLLOWING})

#: Export targets by name.
TARGETS: Table[Target] = Table(
    "truespring.targets",
    {
        "calculix": Target(
            calculix,
            "CalculiX decks: springs.inp of SPRINGA elements or twin.inp of finite elements, and fem.inp",
            "CalculiX",
            NAMES,
            DECKS,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
            details=calculix_values,
        ),
        "abaqus": Target(
            abaqus,
            "the same for Abaqus",
            "Abaqus",
            NAMES,
            DECKS,
            expressed=_IN_DECKS,
            left_out=_NOT_IN_DECKS,
            unrun="Abaqus was not run; CalculiX reads the same keywords",
            details=abaqus_values,
        ),
        "mujoco": Target(
            mujoco,
            "MuJoCo MJCF: springs.xml of bodies on slide joints and tendons, drive.py for other springs",
            "MuJoCo",
            ("springs.xml", "drive.py", "spring_forces.py", "springs.npz", "flex.xml"),
            ALL,
            expressed="Nodes are bodies on slide joints, loads are actuators, the surface is a flex. Springs that are "
            "straight are spatial tendons; others, and elements, are forces that drive.py adds in each step. flex.xml "
            "is an approximation by MuJoCo's own finite elements.",
            left_out="The surface has no contact without the option contact.",
            details=mujoco_values,
            options=MappingProxyType({"contact": Option(False, "contact of the surface with other bodies")}),
        ),
        "sofa": Target(
            sofa,
            "a Python scene for SOFA, of springs and finite elements; experimental",
            "SOFA",
            ("springs_scene.py", "truespring_forces.py", "springs.npz"),
            _FOLLOWED | {Feature.NEGATIVE, Feature.VOLUME_TERM, Feature.COUPLING, Feature.PRESSURE},
            expressed="Plain springs are a SpringForceField, others a force field in Python; finite elements are "
            "a node of their own, loads constant forces.",
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
        "warp": Target(
            warp,
            "a Python script of NVIDIA Warp kernels: springs_warp.py, with springs.npz",
            "Warp",
            ("springs_warp.py", "springs.npz", "newton_mount.py"),
            ALL - {Feature.STIFFENING, Feature.FIBRES},
            expressed="Springs, functions of the volume and coupled springs are kernels, in float32 or float64; loads "
            "are constant forces.",
            left_out="Contact is not set up. newton_mount.py was not run.",
        ),
        "febio": Target(
            febio,
            "FEBio 4.0: springs.feb of discrete springs, or of neo-Hookean elements for Gaussian springs",
            "FEBio",
            ("springs.feb",),
            frozenset({Feature.PRESSURE, Feature.FOLLOWING}),
            expressed="Plain springs are discrete elements, Gaussian springs neo-Hookean finite elements: equal on "
            "tetrahedra of first order, on others a twin at small strain only.",
            left_out="Contact is left out; weight is in the nodal forces.",
            unrun="FEBio was not run; the structure is that of its published test suite",
        ),
        "gltf": Target(
            gltf,
            "glTF 2.0: surface.glb, the surface with a morph target of each load level and an animation",
            "glTF",
            ("surface.glb",),
            ALL,
            expressed=_SHAPES,
            left_out=_NO_SPRINGS,
        ),
        "obj": Target(
            obj,
            "Wavefront OBJ: rest.obj and deformed.obj, the surface at rest and at full load",
            "OBJ",
            ("rest.obj", "deformed.obj"),
            ALL,
            expressed=_SHAPES,
            left_out=_NO_SPRINGS,
            options=MappingProxyType({"levels": Option(False, "a file for each load level, level_1.obj and so on")}),
        ),
        "usd": Target(
            usd,
            "Universal Scene Description: surface.usda, the surface with a time sample of each load level",
            "USD",
            ("surface.usda",),
            ALL,
            expressed=_SHAPES,
            left_out=_NO_SPRINGS,
        ),
        "npz": Target(npz, "NumPy arrays: springs.npz", "npz", ("springs.npz",), ALL, _ARRAYS, _NOTHING),
        "json": Target(
            as_json, "the same arrays as text: springs.json", "json", ("springs.json",), ALL, _ARRAYS, _NOTHING
        ),
    },
    Target,
)
