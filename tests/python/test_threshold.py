# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot threshold`: limits of colour from pictures whose truth is known."""

import json

import numpy as np
import pytest
import twinmill_native as native
from PIL import Image
from scipy import ndimage

from twinmill.threshold.box import KEYS, Ball, find_ball, fit_box
from twinmill.threshold.pictures import Picture, from_rgb, read_pictures, split_frames
from twinmill_cli import main as cli
from twinmill_cli import threshold
from twinmill_cli.threshold import write_settings

WIDTH_PX, HEIGHT_PX, MIN_BLOB_PX = 320, 240, 300
GREEN, TEAL, YELLOW, WOOD, GREY = (
    np.array(c, float)
    for c in [(40, 170, 60), (0, 128, 128), (200, 200, 40), (150, 110, 70), (128, 128, 128)]
)


def scene(seed, ball=(160, 120, 30), distractor=None, noise=4.0):
    """A shaded ball on a textured floor, perhaps a disc of another colour, and the truth.

    The ball's light falls off from top to bottom to a half; all is a little noisy.
    """
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    texture = 1 + 0.15 * np.sin(x / 9)[..., None] * np.sin(y / 13)[..., None]
    rgb = (
        np.where((x < 100)[..., None], WOOD, GREY) * texture * (0.8 + 0.4 * x / WIDTH_PX)[..., None]
    )
    if distractor is not None:
        rgb[(x - 260) ** 2 + (y - 60) ** 2 < 35**2] = distractor
    truth = (x - ball[0]) ** 2 + (y - ball[1]) ** 2 < ball[2] ** 2
    light = np.clip(0.75 - 0.25 * (y - ball[1]) / ball[2], 0.5, 1)[..., None]
    rgb = np.where(truth[..., None], GREEN * light, rgb) + random.normal(0, noise, rgb.shape)
    return np.clip(rgb, 0, 255).astype(np.uint8), truth


def scenes(**changes):
    """Three pictures with the ball in different places and sizes."""
    balls = [(160, 120, 30), (60, 180, 18), (250, 190, 40)]
    made = [scene(seed, ball, **changes) for seed, ball in enumerate(balls)]
    pictures = [from_rgb(f"{k}", rgb) for k, (rgb, _) in enumerate(made)]
    return pictures, [Ball(*ball) for ball in balls], [truth for _, truth in made]


def wrong_share(mask, truth):
    """Pixels wrong on either side, as a share of the ball; its edge of two pixels left out."""
    sure = ~(
        ndimage.binary_dilation(truth, iterations=2) ^ ndimage.binary_erosion(truth, iterations=2)
    )
    return np.count_nonzero((mask != truth) & sure) / np.count_nonzero(truth)


def test_colours_are_bt601():
    # The standard's own values: white, black, and 100 % red, green, blue in studio range.
    colours = {
        (255, 255, 255): (235, 128, 128),
        (0, 0, 0): (16, 128, 128),
        (255, 0, 0): (81, 90, 240),
        (0, 255, 0): (145, 54, 34),
        (0, 0, 255): (41, 240, 110),
    }
    for rgb, yuv in colours.items():
        picture = from_rgb("", np.full((2, 4, 3), rgb, np.uint8))
        assert np.all(picture.yuv == yuv)
        assert np.abs(picture.rgb.astype(int) - rgb).max() <= 2


def test_mask_is_the_firmwares():
    random = np.random.default_rng(1)
    yuyv = random.integers(0, 256, (31, 2 * 70), np.uint8)
    box = (40, 200, 30, 140, 20, 150)
    yuv = Picture("", yuyv).yuv
    low, high = np.array(box[::2]), np.array(box[1::2])
    expected = np.all((yuv >= low) & (yuv <= high), axis=2)
    assert np.array_equal(native.inside(yuyv, box), expected)
    labels, _ = ndimage.label(expected, np.ones((3, 3)))
    assert native.largest_blob_px(expected) == np.bincount(labels.ravel())[1:].max()


@pytest.mark.parametrize(
    "distractor", [None, TEAL, YELLOW, WOOD], ids=["none", "teal", "yellow", "wood"]
)
def test_limits_find_the_ball_and_little_else(distractor):
    pictures, balls, truths = scenes(distractor=distractor)
    fitted = fit_box(pictures, balls, MIN_BLOB_PX)
    assert fitted.problem == ""
    for picture, truth in zip(pictures, truths, strict=True):
        assert wrong_share(native.inside(picture.yuyv, fitted.box), truth) < 0.05


def test_limits_hold_in_pictures_that_were_not_shown():
    pictures, balls, _ = scenes(distractor=TEAL)
    fitted = fit_box(pictures, balls, MIN_BLOB_PX)
    for seed in range(10, 15):
        rgb, truth = scene(seed, (120 + 10 * seed % 150, 100, 25), TEAL)
        dimmer = from_rgb("", (rgb * 0.9).astype(np.uint8))
        assert wrong_share(native.inside(dimmer.yuyv, fitted.box), truth) < 0.05


def test_loose_limits_take_the_teal_that_fitted_ones_leave_out():
    pictures, balls, _ = scenes(distractor=TEAL)
    fitted = fit_box(pictures, balls, MIN_BLOB_PX)
    old = native.largest_blob_px(native.inside(pictures[1].yuyv, (40, 235, 0, 160, 0, 108)))
    assert old > 2000 and fitted.results[1].false_blob_px < 10


def test_same_colour_elsewhere_cannot_be_told_apart():
    pictures, balls, _ = scenes(distractor=GREEN * 0.8)
    assert "same colour" in fit_box(pictures, balls, MIN_BLOB_PX).problem


def test_grey_ball_cannot_be_told_apart():
    rgb, _ = scene(0, (60, 180, 0.5))
    assert fit_box([from_rgb("a", rgb)], [Ball(200, 100, 25)], MIN_BLOB_PX).problem


def test_ball_too_small_for_the_robot_is_said():
    rgb, _ = scene(0, (160, 120, 8))
    assert "min_blob_px" in fit_box([from_rgb("a", rgb)], [Ball(160, 120, 8)], MIN_BLOB_PX).problem


def test_ball_is_found_by_itself():
    pictures, balls, _ = scenes()
    for picture, ball in zip(pictures, balls, strict=True):
        found = find_ball(picture)
        assert np.hypot(found.x_px - ball.x_px, found.y_px - ball.y_px) < 0.15 * ball.radius_px
        assert found.radius_px == pytest.approx(ball.radius_px, rel=0.15)


def with_rectangle(rgb, left, top, width, height):
    rgb = rgb.copy()
    rgb[top : top + height, left : left + width] = GREEN
    return rgb


@pytest.mark.parametrize("size", [(70, 60), (64, 64), (120, 40)])
def test_a_larger_green_rectangle_is_no_ball(size):
    rgb, _ = scene(0, (60, 180, 25))
    found = find_ball(from_rgb("a", with_rectangle(rgb, 180, 20, *size)))
    assert (found.x_px, found.y_px) == pytest.approx((60, 180), abs=4)


def test_a_rectangle_alone_is_refused_and_said_where():
    rgb, _ = scene(0, (160, 120, 0.5))
    with pytest.raises(ValueError, match=r"a: the largest green thing, at 21\d,5\d, is not round"):
        find_ball(from_rgb("a", with_rectangle(rgb, 180, 20, 70, 60)))


def test_the_picture_whose_ball_was_mistaken_is_the_one_that_is_named():
    pictures, balls, _ = scenes(distractor=TEAL)
    taken = [balls[0], Ball(260, 60, 30), balls[2]]  # the teal disc of the second
    problem = fit_box(pictures, taken, MIN_BLOB_PX).problem
    assert problem.startswith("1: what was taken for the ball, at 260,60, has another colour")


def test_two_balls_are_not_guessed_between():
    rgb, _ = scene(0, distractor=GREEN)
    with pytest.raises(ValueError, match=r"the things at \d+,\d+ and at \d+,\d+"):
        find_ball(from_rgb("a", rgb))


def test_raw_and_png_give_the_same_limits(tmp_path):
    rgb, _ = scene(3)
    Image.fromarray(rgb).save(tmp_path / "a.png")
    (tmp_path / "a.yuyv").write_bytes(from_rgb("", rgb).yuyv.tobytes())
    png, raw = read_pictures([tmp_path / "a.png", tmp_path / "a.yuyv"], (WIDTH_PX, HEIGHT_PX))
    assert np.array_equal(png.yuyv, raw.yuyv)


def test_raw_of_another_size_is_refused():
    with pytest.raises(ValueError, match="give size"):
        split_frames("a.yuyv", b"1" * 100, (8, 8))


def test_configuration_keeps_its_other_lines(tmp_path):
    path = tmp_path / "turbopi.conf"
    path.write_text("# mine\nrobot_id = 3\ny_min = 1\nv_max=7\n")
    write_settings(path, dict(zip(KEYS, (10, 20, 30, 40, 50, 60), strict=True)))
    assert path.read_text() == (
        "# mine\nrobot_id = 3\n"
        "y_min = 10\ny_max = 20\nu_min = 30\nu_max = 40\nv_min = 50\nv_max = 60\n"
    )
    assert [p.name for p in tmp_path.iterdir()] == ["turbopi.conf"]


def test_command_writes_limits_and_a_picture(tmp_path, capsys):
    files = []
    for seed in range(2):
        files.append(tmp_path / f"{seed}.jpg")
        Image.fromarray(scene(seed, distractor=TEAL)[0]).save(files[-1], quality=90)
    config, picture = tmp_path / "turbopi.conf", tmp_path / "seen.png"
    code = cli.run(["threshold", *map(str, files), "--ball", "160,120,30", "--json",
                    "--config", str(config), "--picture", str(picture)])  # fmt: skip
    told = json.loads(capsys.readouterr().out)
    assert code == 0 and told["separable"] and len(told["pictures"]) == 2
    assert config.read_text().splitlines() == [f"{k} = {v}" for k, v in told["box"].items()]
    with Image.open(picture) as image:
        assert image.width > 600


def test_nothing_is_written_when_it_cannot_be_told_apart(tmp_path, capsys):
    path, config = tmp_path / "a.png", tmp_path / "turbopi.conf"
    Image.fromarray(scene(0, distractor=GREEN)[0]).save(path)
    config.write_text("robot_id = 3\n")
    code = cli.run(["threshold", str(path), "--ball", "160,120,30", "--config", str(config)])
    assert code == 1 and config.read_text() == "robot_id = 3\n"
    assert "Cannot be told apart" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "one of them"),
        (["a.png", "--camera", "/dev/video9"], "one of them"),
        (["a.png", "--write"], "--robot"),
        (["a.png", "--ball", "1,2"], "X,Y,R"),
        (["a.png", "--ball", "900,2,9"], "not in its"),
        (["a.png", "--size", "3x3"], "WIDTHxHEIGHT"),
        (["b.png"], "is no picture"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    Image.fromarray(scene(0)[0]).save("a.png")
    (tmp_path / "b.png").write_text("no picture")
    with pytest.raises(ValueError, match=words):
        cli.run(["threshold", *arguments])


# sRGB of the balls; which colours lie apart is plain from BT.601: red has much V, blue much U.
BALLS = {"green": (40, 170, 60), "red": (200, 40, 40), "blue": (40, 70, 200)}


def coloured(name, seed, rgb):
    """A picture of one ball of a colour on the floor, with noise."""
    pixels, truth = scene(seed, (160, 120, 25), noise=0)
    pixels[truth] = rgb
    random = np.random.default_rng(seed).normal(0, 4, pixels.shape)
    return from_rgb(name, np.clip(pixels + random, 0, 255).astype(np.uint8))


def test_limits_of_several_colours_take_no_other_ball():
    pictures = {name: coloured(name, k, rgb) for k, (name, rgb) in enumerate(BALLS.items())}
    names = list(pictures)
    balls = [find_ball(pictures[name], name) for name in names]
    for ball in balls:
        assert np.hypot(ball.x_px - 160, ball.y_px - 120) < 2
    found = threshold._fit(list(pictures.values()), names, balls, MIN_BLOB_PX)
    assert threshold._problem(found) == ""
    for name, fitted in found.items():
        for other, picture in pictures.items():
            blob = native.largest_blob_px(native.inside(picture.yuyv, fitted.box))
            assert (blob > MIN_BLOB_PX) == (name == other), (name, other)
    settings = threshold._settings(found)
    assert list(settings) == [*KEYS, "bit2", "bit3"]
    assert settings["bit2"] == ",".join(["all", *map(str, found["red"].box)])


def test_two_colours_that_are_one_are_named():
    pictures = [coloured("a", 1, BALLS["red"]), coloured("b", 2, (210, 45, 42))]
    balls = [find_ball(picture, "red") for picture in pictures]
    problem = threshold._problem(threshold._fit(pictures, ["red", "orange"], balls, MIN_BLOB_PX))
    assert "red and orange overlap" in problem
