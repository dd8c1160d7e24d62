"""Pictures show a scene as it is: fitted, what is nearer before the rest, readable without colour."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from hexacell.drawing.braille import braille_lines
from hexacell.drawing.camera import Camera
from hexacell.drawing.shapes import Form, Role, Shape, arrows
from hexacell.drawing.svg import svg_of

SVG = "{http://www.w3.org/2000/svg}"


def test_a_camera_shows_all_points_as_large_as_the_frame_allows(any_robot) -> None:
    camera = Camera.fitted(any_robot.scene, (300.0, 200.0), 10.0)
    places = np.concatenate([camera.places(one.points) for one in any_robot.scene])
    assert (places >= 9.999).all()
    assert (places <= [290.001, 190.001]).all()
    assert np.isclose(np.ptp(places, axis=0), [280.0, 180.0]).any()


def test_the_axes_are_seen_as_by_somebody_who_stands_there() -> None:
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    camera = Camera.fitted((Shape(Form.LINE, Role.X, corners),), (100.0, 100.0), 0.0)
    origin, x, y, z = camera.places(corners)
    assert x[0] > y[0] > origin[0]  # in front, somewhat to the right
    assert z[1] < y[1] < origin[1] < x[1]  # and above; the frame counts downward


def test_what_is_nearer_covers_what_is_behind_but_no_word_and_no_error() -> None:
    far, near = np.array([[0.0, 5.0, 0.0], [1.0, 5.0, 0.0]]), np.array([[0.0, -5.0, 0.0], [1.0, -5.0, 0.0]])
    word = Shape(Form.WORD, Role.LEG, far[:1], text="1")
    lines = [Shape(Form.LINE, Role.LEG, ends) for ends in (near, far)]
    scene = (word, *lines, *arrows(Role.AFTER, far[:1], far[1:]))
    ordered = Camera.fitted(scene, (10.0, 10.0), 0.0).back_to_front(scene)
    assert [np.array_equal(one.points, near) for one in ordered[:2]] == [False, True]
    assert {ordered[2].role, ordered[3].role} == {Role.LEG, Role.AFTER}


def test_an_svg_is_whole_named_the_same_each_time_and_needs_nothing_else(any_robot) -> None:
    title = 'a <robot> & "its" legs'
    drawn = svg_of(any_robot.scene, title, "six legs")
    picture = ET.fromstring(drawn)
    assert (picture.get("role"), picture.findtext(f"{SVG}title")) == ("img", title)
    assert picture.findtext(f"{SVG}desc") == "six legs"
    assert drawn == svg_of(any_robot.scene, title, "six legs")
    words = [one.text for one in picture.iter(f"{SVG}text")]
    legs = "123456"[: any_robot.robot.mechanism.joint_count]
    assert {*legs, "+x", "+y", "+z", "gauge x", "gauge y", "gauge z"} == set(words)
    assert not re.search(r"href|url\(|@import|<style|font-family=\"(?!sans-serif)", drawn)
    assert not re.search(r"\d\.\d{3}|nan|inf", drawn)
    left, top, width, height = map(float, (picture.get("viewBox") or "").split())
    for text in picture.iter(f"{SVG}text"):
        assert left <= float(text.get("x", "nan")) <= left + width
        assert top <= float(text.get("y", "nan")) <= top + height


def test_a_small_error_is_a_dot_in_its_colour_and_a_large_one_an_arrow(hexaglide) -> None:
    at = hexaglide.pose.position[None]
    for vector, tags in (([[0.01, 0.0, 0.0]], {"circle"}), ([[200.0, 0.0, 0.0]], {"path"})):
        scene = hexaglide.scene + arrows(Role.AFTER, at, np.array(vector))
        painted = [
            one for one in ET.fromstring(svg_of(scene, "", "")).iter() if "#2166ac" in one.attrib.values()
        ]
        assert {one.tag.removeprefix(SVG) for one in painted} == tags


@pytest.mark.parametrize(("width", "height"), [(60, 24), (30, 12), (100, 30)])
def test_characters_fill_the_lines_and_all_legs_keep_their_numbers(any_robot, width, height) -> None:
    lines = braille_lines(any_robot.scene, width, height)
    texts = ["".join(run.text for run in line) for line in lines]
    assert [len(text) for text in texts] == [width] * height
    assert all(sign in " +xyzgaue123456" or 0x2800 < ord(sign) <= 0x28FF for sign in "".join(texts))
    if width >= 60:
        legs = "".join(run.text for line in lines for run in line if run.role is Role.LEG)
        assert set(re.sub(r"[^\d]", "", legs)) == set("123456"[: any_robot.robot.mechanism.joint_count])
    assert all((run.role is None) == (not run.text.strip()) for line in lines for run in line)
