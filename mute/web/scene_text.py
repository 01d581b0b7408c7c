"""The scene as MJCF text that the page's MuJoCo can load, equal to the compiled one to the bit.

The page has MuJoCo 3 as WebAssembly. What `MjSpec.to_xml` of MuJoCo 4 writes, it cannot load, and
numbers have six digits there. So the robot is taken from its own file, as it was written, and what
surrounds it from the assembled scene.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from mute.envs.batch_simulation import as_stepped
from mute.envs.scene import SceneCfg, build_scene, make_spec
from mute.support.resources import RESOURCES

__all__ = ["check_same", "scene_text"]

_ROBOT_FILE = RESOURCES / "go1" / "go1.xml"

_OWN_NAMES = ("names", "paths", "text_data")
"""Arrays that hold what things are called, and nothing that moves."""


def scene_text(cfg: SceneCfg) -> str:
    """Return a scene as MJCF: visual shapes too, without textures, sky and light.

    Raises:
        RuntimeError: If it would compile to another model than Python steps.
    """
    saved = ElementTree.fromstring(make_spec(cfg).to_xml())
    root = ElementTree.parse(_ROBOT_FILE).getroot()
    root.set("model", "go1_scene")
    _set_gains(root, cfg)
    option = _part(saved, "option")
    # As on the CPU in Python, see `as_stepped`.
    _part(option, "flag").set("midphase", "disable")
    root.insert(1, option)
    world = _part(root, "worldbody")
    for index, geom in enumerate(saved.findall("worldbody/geom")):
        geom.attrib.pop("material", None)
        geom.attrib.pop("class", None)
        _set_exact(geom, cfg)
        world.insert(index, geom)
    root.append(_part(saved, "sensor"))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    check_same(text, cfg)
    return text


def check_same(text: str, cfg: SceneCfg) -> None:
    """Check that MJCF compiles to the model that Python steps, to the last bit.

    Raises:
        RuntimeError: If it does not.
    """
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.discardvisual = True
    written, stepped = spec.compile(), as_stepped(build_scene(cfg, pictured=False))
    different = [name for name in dir(stepped) if _differs(written, stepped, name)]
    different += [f"opt.{name}" for name in _OPTIONS if _differs(written.opt, stepped.opt, name)]
    if different:
        raise RuntimeError(f"the page's scene differs from Python's in {', '.join(different)}")


_OPTIONS = [name for name in dir(mujoco.MjOption) if not name.startswith("_")]


def _differs(one: object, other: object, name: str) -> bool:
    if name.startswith("_") or name in _OWN_NAMES or name.startswith(("name_", "tex_", "mat_")):
        return False
    a, b = getattr(one, name), getattr(other, name)
    if isinstance(b, np.ndarray):
        return a.shape != b.shape or not np.array_equal(a, b)
    return isinstance(b, int | float) and name not in _SIZES and a != b


_SIZES = {
    "nbuffer",
    "nnames",
    "nnames_map",
    "ntex",
    "ntexdata",
    "nmat",
    "npaths",
    "narena",
    "nlight",
}
"""Sizes of memory, and of what is only seen."""


def _part(parent: Element, tag: str) -> Element:
    found = parent.find(tag)
    if found is None:
        raise RuntimeError(f"the scene has no element {tag}")
    return found


def _set_gains(root: Element, cfg: SceneCfg) -> None:
    for servo in root.findall("default//position"):
        servo.set("kp", repr(cfg.stiffness))
        servo.set("kv", repr(cfg.damping))


def _set_exact(geom: Element, cfg: SceneCfg) -> None:
    """Write in full what six digits cut off."""
    if "solref" in geom.attrib:
        geom.set("solref", " ".join(map(repr, cfg.floor_solref)))
    if "quat" in geom.attrib:
        half = repr(0.5**0.5)
        geom.set("quat", f"{half} 0 0 {half}")
