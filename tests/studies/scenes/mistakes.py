"""Kinds of mistakes of a scene file: what makes them, the entry that is told, and words of it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

Tables = dict[str, Any]


def put(*path: Any) -> Callable[[Tables], None]:
    """Return what writes the last of ``path`` at the place that the others lead to."""

    def change(tables: Tables) -> None:
        at: Any = tables
        for key in path[:-2]:
            at = at[key]
        at[path[-2]] = copy.deepcopy(path[-1])

    return change


def rigid(**changes: Any) -> Callable[[Tables], None]:
    body = {"surfaces": {"face": {"kind": "line", "points": [[-1, 2.5], [5, 2.5]]}}} | changes
    return put("rigid", {"plate": body})


def seen_on(**x: Any) -> Callable[[Tables], None]:
    along = {"start": -1.0, "stop": 1.0, "num": 9}
    return put("results", "map", {"x": along | x, "y": along})


def without(*path: Any) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        at: Any = tables
        for key in path[:-1]:
            at = at[key]
        del at[path[-1]]

    return change


SHAPE = ("bodies", "upper", "shape")
MOVING = {
    "body": "upper",
    "boundary": "top",
    "kind": "travelling_pressure",
    "peak": 9.0,
    "half_width": 1.0,
}
"""A load that moves."""
MISTAKES: dict[str, tuple[Callable[[Tables], object], str, str]] = {
    "text for a number": (
        put("contacts", 0, "friction", "high"),
        "contacts[0].friction",
        "must be a number, or an expression, which names parameters as $name",
    ),
    "number out of range": (
        put("contacts", 0, "friction", -1.0),
        "contacts[0].friction",
        "at least 0",
    ),
    "infinite number": (put("loads", 0, "value", float("inf")), "loads[0].value", "finite"),
    "unknown entry": (
        put("contacts", 0, "frictoin", 0.1),
        "contacts[0].frictoin",
        "did you mean friction?",
    ),
    "a stage repeated that is none": (
        put("repeat", {"stages": ["pres"], "times": 3}),
        "repeat.stages",
        "must be one of",
    ),
    "an output minus no stage": (
        put(
            "outputs", {"high": {"of": "mises", "body": "upper", "stage": "pressed", "minus": "x"}}
        ),
        "outputs.high.minus",
        "must be one of",
    ),
    "no function of position": (
        put("loads", 0, "value", "1 - q*x"),
        "loads[0].value",
        "must be a number, a table or an expression of x and y; this one q is unknown",
    ),
    "a field that has no value": (
        put("loads", 0, "value", "sqrt(x - 1e9)"),
        "pressure.top",
        "must be finite at all points [MPa]",
    ),
    "unknown table": (put("body", {}), "body", "did you mean bodies?"),
    "text in a shape": (put(*SHAPE, "size", "fine"), "bodies.upper.shape.size", "number"),
    "unknown entry of a shape": (
        put(*SHAPE, "sise", 0.1),
        "bodies.upper.shape.sise",
        "did you mean size?",
    ),
    "no parameter in a shape": (
        put(*SHAPE, "size", "$fine"),
        "bodies.upper.shape.size",
        "$fine is no parameter",
    ),
    "unknown entry of a rigid body": (
        rigid(radius=3.0),
        "rigid.plate.radius",
        "there is no such entry; there are surfaces, centre, x, y, rotation",
    ),
    "unknown entry of a motion": (
        rigid(y={"pushd": -1.0}),
        "rigid.plate.y.pushd",
        "there are moved, pushed, amplitude, locked; did you mean pushed?",
    ),
    "missing entry": (without("loads", 0, "boundary"), "loads[0].boundary", "must be given"),
    "unknown kind": (
        put("loads", 0, "kind", "presure"),
        "loads[0].kind",
        "must be one of body_force, centrifugal, displacement, gravity, initial_stress, pressure, "
        "temperature, traction, travelling_pressure; did you mean pressure?",
    ),
    "no kind": (without(*SHAPE, "kind"), "bodies.upper.shape.kind", "must be one of disc, fillet"),
    "wrong derived number": (
        lambda t: t.update(derived={"side": "$sid"}),
        "derived.side",
        "$sid is no parameter",
    ),
    "derived number of a parameter without its sign": (
        lambda t: t.update(derived={"side": "3 - (1 - wide)"}),
        "derived.side",
        "wide is unknown: write $wide for a parameter",
    ),
    "list for a default": (
        put("parameters", "wide", "default", [3.0]),
        "parameters.wide.default",
        "must be true or false, an integer, a number or a text",
    ),
    "expression for a default": (
        put("parameters", "wide", "default", "2*$mu"),
        "parameters.wide.default",
        "must be a value",
    ),
    "list too short by a wrong entry": (
        rigid(surfaces={"face": {"kind": "line", "points": [[0, "here"], [5, 2.5]]}}),
        "rigid.plate.surfaces.face.points[0][1]",
        "must be a number",
    ),
    "unknown word": (put("kinematics", "flat"), "kinematics", "one of plane_strain, "),
    "unknown element": (
        put("bodies", "upper", "element", "hex9"),
        "bodies.upper.element",
        "must be one of quad8",
    ),
    "unknown parameter": (
        put("contacts", 0, "friction", "$nu"),
        "contacts[0].friction",
        "$nu is no parameter",
    ),
    "no arithmetic": (put("loads", 0, "value", "2*($wide"), "loads[0].value", "read as arithmetic"),
    "without effect": (put("contacts", 0, "friction", 0.1), "parameters.mu", "has no effect"),
    "default out of range": (
        put("parameters", "mu", "default", 2.0),
        "parameters.mu.default",
        "in its range, 0 to 1",
    ),
    "default not a choice": (
        put("parameters", "rule", "default", "kinematic"),
        "parameters.rule.default",
        "one of its choices",
    ),
    "needs an unknown parameter": (
        put("parameters", "wide", "needs", {"mus": [0.3]}),
        "parameters.wide.needs",
        "must be one of",
    ),
    "needs text of a number": (
        put("parameters", "wide", "needs", {"mu": ["0.3"]}),
        "parameters.wide.needs.mu",
        "must be a number",
    ),
    "needs no choice": (
        put("parameters", "wide", "needs", {"rule": {"other_than": "nones"}}),
        "parameters.wide.needs.rule",
        "did you mean none",
    ),
    "name taken": (
        put("outputs", {"plastic_work": {"of": "mises", "stage": "pressed", "body": "lower"}}),
        "outputs.plastic_work",
        "choose another",
    ),
    "names of outputs that meet": (
        put("outputs", "least_x", {"of": "mises", "stage": "pressed", "body": "lower"}),
        "outputs.least_x",
        "the data set has least_x already",
    ),
    "parameter with a word of Python": (
        lambda t: (
            put("parameters", "lambda", {"default": 0.2})(t)
            or put("contacts", 0, "cohesion", "$lambda")(t)
        ),
        "parameters.lambda",
        "choose another",
    ),
    "number beyond all bounds": (
        put("parameters", "wide", {"default": 10**400, "unit": "mm"}),
        "parameters.wide.default",
        "at most 1e+100",
    ),
    "size far too small": (
        put(*SHAPE, "near", [{"at": [0, 0], "size": 1e-12, "radius": 1.0}]),
        "bodies.upper.shape.size",
        "elements along",
    ),
    "unknown material": (
        put("bodies", "upper", "material", "brass"),
        "bodies.upper.material",
        "one of steel",
    ),
    "unknown body": (put("loads", 0, "body", "top"), "loads[0].body", "one of upper, lower"),
    "unknown body of a surface": (
        put("contacts", 0, "slave", "top.bottom"),
        "contacts[0].slave",
        "one of upper, lower",
    ),
    "unknown stage": (
        put("outputs", "least", "stage", "loaded"),
        "outputs.least.stage",
        "one of pressed",
    ),
    "unknown stage of a position": (
        put("loads", 0, MOVING | {"position": {"presed": 1.0}}),
        "loads[0].position",
        "did you mean pressed?",
    ),
    "a number for a position": (
        put("loads", 0, MOVING | {"position": 1.0}),
        "loads[0].position",
        "must be",
    ),
    "unknown stage of an amplitude": (
        put("loads", 0, "amplitude", {"later": 1.0}),
        "loads[0].amplitude",
        "one of pressed",
    ),
    "a release repeated alone": (
        lambda content: content.update(
            stages=[*content["stages"], {"name": "free", "release": True}],
            repeat={"stages": ["free"], "times": 2},
        ),
        "repeat.stages",
        "must hold a stage that loads the bodies",
    ),
    "number with a unit": (
        put("materials", "steel", "youngs_modulus", "195 GN"),
        "materials.steel.youngs_modulus",
        "must be a number in MPa; GN is a force",
    ),
    "unit of an entry without one": (
        put("loads", 0, "amplitude", {"pressed": "2 in"}),
        "loads[0].amplitude.pressed",
        "must be a number without a unit: in N, mm, MPa",
    ),
    "unit beside a field that looks like one": (
        lambda content: (
            content["loads"][0].update(value="2/x"),
            content["bodies"]["upper"]["shape"].update(size="2 N"),
        ),
        "bodies.upper.shape.size",
        "must be a number in mm; N is a force",
    ),
    "unit of a load": (
        put("loads", 0, "value", "2 m"),
        "loads[0].value",
        "must be a number in MPa; m is a length",
    ),
    "unit of a default": (
        put("parameters", "wide", "default", "4 s"),
        "parameters.wide.default",
        "must be a number in mm; s is a time",
    ),
    "unknown region that is removed": (
        put("stages", 0, "remove", ["upper.skin"]),
        "stages[0].remove",
        "must name a region of upper: it has none",
    ),
    "region without elements": (
        put("bodies", "upper", "regions", {"skin": {"x": [90.0, 91.0]}}),
        "bodies.upper.regions.skin",
        "has no element in its box",
    ),
    "unknown stage of a pair": (
        put("contacts", 0, "active", ["later"]),
        "contacts[0].active",
        "one of pressed",
    ),
    "unknown stage of wear": (
        put("results", "wear", {"since": "pressed", "until": "later"}),
        "results.wear.until",
        "one of pressed",
    ),
    "wear without its first stage": (
        put("results", "wear", {"until": "pressed"}),
        "results.wear.since",
        "must be given",
    ),
    "a line outside of its body": (
        put("results", "lines", "middle", {"body": "lower", "start": [9.0, 0.0], "end": [9, -2]}),
        "results.lines.middle",
        "must meet the body lower",
    ),
    "a point outside of its body": (
        put("results", "points", {"p": {"body": "upper", "at": [2.0, -1.0]}}),
        "results.points.p",
        "must meet the body upper",
    ),
    "a power as in Python": (
        put("loads", 0, "value", "$wide**2"),
        "loads[0].value",
        "a power is written with ^",
    ),
    "an end of a stage with a take": (
        put(
            "outputs",
            {
                "f": {
                    "of": "normal_force",
                    "contact": "face",
                    "stage": "pressed",
                    "take": "minimum",
                }
            },
        ),
        "outputs.f.take",
        "must be left out",
    ),
    "a motion of a body": (
        put("outputs", {"f": {"of": "motion.x", "part": "upper", "stage": "pressed"}}),
        "outputs.f.part",
        "must be one of",
    ),
    "a reaction along a line": (
        put("outputs", {"f": {"of": "reaction.x", "line": "middle", "stage": "pressed"}}),
        "outputs.f",
        "needs one of part",
    ),
    "output nowhere": (
        without("outputs", "least", "body"),
        "outputs.least",
        "needs one of body, line",
    ),
    "shape and mesh": (
        put("bodies", "upper", "mesh", "a.msh"),
        "bodies.upper.shape",
        "one of the two",
    ),
    "mesh not there": (
        lambda t: (
            t["bodies"]["upper"].update(mesh="a.msh", shape=None)
            or t["bodies"]["upper"].pop("shape")
        ),
        "bodies.upper.mesh",
        "no such file",
    ),
    "a stage of two words": (
        put("stages", 0, "name", "o n"),
        "stages[0].name",
        "1 to 60 of A-Z a-z 0-9 _, beginning with a letter",
    ),
    "a body alone": (
        put("contacts", 0, "slave", "upper"),
        "contacts[0].slave",
        "a boundary of a body, such as punch.bottom",
    ),
    "mesh elsewhere": (
        put("bodies", "upper", "mesh", "../a.msh"),
        "bodies.upper.mesh",
        "must be the name of a file beside the scene file",
    ),
    "stages and loading": (
        put("loading", {"factor": 1.0, "step": 0.1}),
        "stages",
        "one of the two",
    ),
    "two of one name": (
        lambda t: t["stages"].append({"name": "pressed"}),
        "stages",
        "two have this name",
    ),
    "wrong place of a line": (
        put("results", "lines", "middle", "radius", 1.0),
        "results.lines.middle",
        "start and end, or",
    ),
    "map from right to left": (
        seen_on(stop=-1.5),
        "results.map.x.stop",
        "must be > start = -1",
    ),
    "map beside the bodies": (
        seen_on(start=20.0, stop=30.0),
        "results.map",
        "must meet a body",
    ),
    "map with half of a grading": (
        seen_on(near=0.0),
        "results.map.x.size",
        "near and size go together",
    ),
    "map graded to what it has not": (
        seen_on(near=2.0, size=0.1),
        "results.map.x.near",
        "must be from -1 to 1",
    ),
    "map graded too much": (
        seen_on(near=0.0, size=1e-9),
        "results.map.x.size",
        "is too small for 9 points",
    ),
    "list of a wrong length": (
        put("results", "lines", "middle", "end", [1.0]),
        "results.lines.middle.end[1]",
        "must be given",
    ),
    "unknown boundary": (
        put("loads", 0, "boundary", "topp"),
        "loads[0].boundary",
        "must name a boundary of upper: left, right, bottom, top; did you mean top?",
    ),
    "unknown contact boundary": (
        put("contacts", 0, "master", "lower.up"),
        "contacts[0].master",
        "must name a boundary of lower",
    ),
    "unknown boundary of a support": (
        put("bodies", "upper", "supports", {"lef": "x"}),
        "bodies.upper.supports.lef",
        "did you mean left?",
    ),
    "unknown surface": (
        lambda t: rigid()(t) or put("contacts", 0, "slave", "plate.side")(t),
        "contacts[0].slave",
        "must name a boundary of plate: face",
    ),
    "size too large": (put(*SHAPE, "size", 1e-5), "bodies.upper.shape.size", "200000"),
    "shape inside out": (put(*SHAPE, "x", [4, 0]), "bodies.upper.shape.x", "increasing"),
    "body left free": (
        without("bodies", "lower", "supports"),
        "supports",
        "body 'upper' can move freely|body 'lower' can move freely",
    ),
    "load on a body that nothing holds any more": (
        lambda t: (
            t["contacts"][0].update(active=["pressed"]) or t["stages"].append({"name": "gone"})
        ),
        "supports",
        "body 'upper' is free to move along y at 1 of stage gone",
    ),
    "loads released before they act": (
        put("stages", 0, "release", True),
        "stages[0].release",
        "none has acted before",
    ),
    "bodies apart": (
        put("bodies", "upper", "move", [0.0, 0.5]),
        "bodies.upper",
        "stands 0.5 mm away",
    ),
    "bodies overlap": (
        put("bodies", "upper", "move", [0.0, -0.5]),
        "contacts",
        "overlaps 'lower' by 0.5 mm",
    ),
    "hardening without its curve": (
        put("parameters", "rule", {"default": "table", "choices": ["table"]}),
        "materials.steel.curve",
        "must be points",
    ),
    "axis crossed": (
        lambda t: t.update(kinematics="axisymmetric") or put(*SHAPE, "x", [-1, 3])(t),
        "bodies.upper.mesh",
        "x >= 0",
    ),
    "rigid both moved and pushed": (
        rigid(x={"moved": 1.0, "pushed": 2.0}),
        "rigid.plate.x",
        "not both",
    ),
    "singular without radius": (
        put("singular", [{"at": [0.0, 0.0]}]),
        "singular[0].radius",
        "must be given",
    ),
    "singular of no size": (
        put("singular", [{"at": [0.0, 0.0], "radius": 0.0}]),
        "singular[0].radius",
        "greater than 0",
    ),
    "allowed what is nothing": (put("allow", ["everything"]), "allow[0]", "large_strain"),
    "rigid without surface": (rigid(surfaces={}), "rigid.plate.surfaces", "1 or more"),
    "link to no body": (put("links", [{"slave": "uper.top"}]), "links[0].slave", "mean upper?"),
    "link to no boundary": (put("links", [{"slave": "upper.tp"}]), "links[0].slave", "mean top?"),
    "link that contact bears": (
        put("links", [{"slave": "upper.bottom"}]),
        "links[0].slave",
        "link or contact, not both",
    ),
    "tie of a boundary with itself": (
        put("links", [{"slave": "upper.top", "master": "upper.top"}]),
        "links[0].master",
        "must be another surface",
    ),
    "spring without stiffness": (
        put("links", [{"slave": "upper.top", "stiffness": 0.0}]),
        "links[0].stiffness",
        "greater than 0",
    ),
    "lock at no stage": (
        rigid(y={"pushed": -1.0, "locked": "presed"}),
        "rigid.plate.y.locked",
        "did you mean pressed?",
    ),
    "lock of a prescribed motion": (
        rigid(y={"moved": -1.0, "locked": "pressed"}),
        "rigid.plate.y.locked",
        "needs pushed",
    ),
    "rigid of one name": (
        lambda t: rigid()(t) or t["rigid"].update(upper=t["rigid"].pop("plate")),
        "rigid",
        "two have this name",
    ),
}
