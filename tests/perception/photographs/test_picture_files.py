from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from msrr_perception.detection.detector import PupilDetector
from msrr_perception.photographs.picture_files import PictureError, picture_files, read_picture, read_pictures
from msrr_perception.photographs.tag_finder import TagFinder
from msrr_perception.photographs.tagged_pictures import picture_names, tagged_pictures
from msrr_scenes.geometry.lens import Lens
from msrr_scenes.geometry.pinhole import PinholeCamera
from msrr_scenes.messages import Pixels

#: EXIF block of a JPEG that says: turn by 90 degrees (orientation 6).
EXIF_TURNED = (
    b"\xff\xe1\x00\x22Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00"
    b"\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00"
)


def _write(folder: Path, name: str, image: np.ndarray) -> Path:
    file = folder / name
    assert cv2.imwrite(str(file), image)
    return file


@pytest.mark.parametrize("name", ["a.png", "a.pgm", "a.tiff", "a.bmp"])
def test_grey_pictures_come_back_as_they_are(tmp_path: Path, two_tags: Pixels, name: str) -> None:
    np.testing.assert_array_equal(read_picture(_write(tmp_path, name, two_tags)), two_tags)


def test_colours_16_bits_and_exif_change_no_tag(tmp_path: Path, two_tags: Pixels) -> None:
    """Each is read as the grey picture: same tags, corners apart by what JPEG costs."""
    jpeg = cv2.imencode(".jpg", two_tags, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    turned = tmp_path / "turned.jpg"
    turned.write_bytes(jpeg[:2] + EXIF_TURNED + jpeg[2:])
    upright = cv2.imdecode(np.frombuffer(turned.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert upright.shape == two_tags.shape[::-1]  # others do turn it
    files = [
        turned,
        _write(tmp_path, "colour.png", cv2.cvtColor(two_tags, cv2.COLOR_GRAY2BGR)),
        _write(tmp_path, "deep.png", two_tags.astype(np.uint16) * 200),
        _write(tmp_path, "twelve.png", two_tags.astype(np.uint16) * 16),
        _write(tmp_path, "clear.png", cv2.cvtColor(two_tags, cv2.COLOR_GRAY2BGRA)),
        _write(tmp_path, "float.tiff", two_tags.astype(np.float32) / 255.0),
    ]
    expected = TagFinder().find(two_tags)
    assert [found.tag.tag_id for found in expected] == [3, 7]
    for file in files:
        pixels = read_picture(file)
        assert (pixels.dtype, pixels.shape) == (np.uint8, two_tags.shape), file.name
        for found, right in zip(TagFinder().find(pixels), expected, strict=True):
            assert np.abs(found.tag.corners - right.tag.corners).max() < 0.1, file.name


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "empty"),
        (b"no picture at all", "not a picture"),
        (b"\x89PNG\r\n\x1a\n" + bytes(40), "not a picture"),
        (b"P5 3 3 255\n" + bytes(9), "3 x 3 px hold no tag"),
        (b"P5 30000 30000 255\n" + bytes(100), "pixels|not a picture"),
    ],
)
def test_what_is_no_picture_is_refused_with_its_name(tmp_path: Path, content: bytes, text: str) -> None:
    file = tmp_path / "bad.pgm"
    file.write_bytes(content)
    with pytest.raises(PictureError, match=rf"bad\.pgm: .*({text})"):
        read_picture(file)


def test_missing_files_folders_and_films_are_refused(tmp_path: Path) -> None:
    (tmp_path / "film.mp4").write_bytes(b"no film")
    with pytest.raises(PictureError, match="cannot be read"):
        read_picture(tmp_path / "missing.png")
    with pytest.raises(PictureError, match="not a film"):
        list(read_pictures(tmp_path / "film.mp4"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(PictureError, match="no picture or film in this folder"):
        picture_files([tmp_path / "empty"])


def test_pictures_of_a_folder_are_in_the_order_of_their_numbers(tmp_path: Path, two_tags: Pixels) -> None:
    names = ["a2.png", "a10.png", "a10b.png", "b.png", "b1.png", "b01.png", "b2_9.png", "b2_10.png"]
    for name in sorted(names):
        cv2.imwrite(str(tmp_path / name), two_tags)
    found = [file.name for file in picture_files([tmp_path])]
    assert found == ["a2.png", "a10.png", "a10b.png", "b.png", "b01.png", "b1.png", "b2_9.png", "b2_10.png"]


def test_one_hot_pixel_of_a_deep_picture_hides_no_tag(tmp_path: Path, two_tags: Pixels) -> None:
    deep = two_tags.astype(np.uint16) * 4
    deep[3, 5] = 65535
    pixels = read_picture(_write(tmp_path, "deep.png", deep))
    assert [found.tag.tag_id for found in TagFinder().find(pixels)] == [3, 7]


def test_a_name_that_is_no_text_is_refused_before_the_work(tmp_path: Path) -> None:
    """Drawing it killed the program, and a table could not hold it."""
    (tmp_path / os.fsdecode(b"\xff.png")).touch()
    with pytest.raises(
        PictureError, match=r"\ufffd.png: the name of this file is not in UTF-8; give it another"
    ):
        picture_files([tmp_path])


def test_names_are_as_long_as_they_have_to_be() -> None:
    """Pictures of two folders of one name were taken for one picture, and the map was wrong by 0.1 m."""
    files = [
        Path(name) for name in ("s/cam/0.png", "t/cam/0.png", "t/cam/0.jpg", "t/cam/1.png", "/t/cam/2.png")
    ]
    names = picture_names(files)
    assert list(map(names.get, files)) == ["s/cam/0.png", "t/cam/0.png", "cam/0.jpg", "1", "2"]


def test_a_picture_that_is_there_twice_is_used_once(tmp_path: Path, two_tags: Pixels) -> None:
    other = np.asarray(255 - two_tags, dtype=np.uint8)
    files = [
        _write(tmp_path, name, p) for name, p in (("a.png", two_tags), ("b.bmp", other), ("c.png", two_tags))
    ]
    lens = Lens(PinholeCamera(two_tags.shape[1], two_tags.shape[0], 200.0))
    repeated: list[tuple[str, str]] = []
    pictures = list(tagged_pictures(files, PupilDetector(), lens, lambda *names: repeated.append(names)))
    assert [picture.name for picture in pictures] == ["a", "b"]
    assert repeated == [(str(files[2]), str(files[0]))]


def test_every_frame_of_a_film_is_read_under_its_number(tmp_path: Path, two_tags: Pixels) -> None:
    file = tmp_path / "film.avi"
    film = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, two_tags.shape[::-1])
    for _ in range(3):
        film.write(cv2.cvtColor(two_tags, cv2.COLOR_GRAY2BGR))
    film.release()
    frames = list(read_pictures(file))
    assert [name for name, _ in frames] == [f"{file}#{i}" for i in range(3)]
    for _, pixels in frames:
        assert [found.tag.tag_id for found in TagFinder().find(pixels)] == [3, 7]


def _mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut a file, overwrite bytes of it, repeat a part of it, or change its head."""
    data = bytearray(content)
    kind = rng.integers(4)
    if kind == 0:
        return bytes(data[: rng.integers(len(data))])
    last = 64 if kind == 3 else len(data)
    for place in rng.integers(0, last, 1 + rng.integers(20)):
        data[place] = rng.integers(256)
    if kind == 2:
        a, b = sorted(rng.integers(0, len(data), 2))
        data[a:a] = data[a:b]
    return bytes(data)


def _fuzz(folder: Path, image: Pixels, count: int) -> int:
    """Read mutated files and find their tags; return how many were refused."""
    kinds = (".png", ".jpg", ".bmp", ".tiff", ".webp", ".pgm")
    whole = {kind: cv2.imencode(kind, image)[1].tobytes() for kind in kinds}
    rng, refused, read, finder = np.random.default_rng(8), 0, 0, TagFinder()
    for i in range(count):
        kind = kinds[i % len(kinds)]
        file = folder / f"mutated{kind}"
        file.write_bytes(_mutated(whole[kind], rng))
        try:
            pixels = read_picture(file)
        except PictureError as error:
            refused += str(error).startswith(str(file))
            continue
        read += 1
        assert pixels.dtype == np.uint8
        if pixels.size <= 4 * image.size:
            finder.find(pixels)
    assert refused + read == count  # every message names its file
    return refused


def test_damaged_files_are_read_or_refused(tmp_path: Path, two_tags: Pixels) -> None:
    assert 0 < _fuzz(tmp_path, two_tags, 90) < 90


@pytest.mark.nightly
def test_two_thousand_damaged_files_are_read_or_refused(tmp_path: Path, two_tags: Pixels) -> None:
    assert 0 < _fuzz(tmp_path, two_tags, 2000) < 2000


def test_what_is_endless_or_too_large_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with pytest.raises(PictureError, match="/dev/zero: not a file"):
        read_picture(Path("/dev/zero"))
    large = tmp_path / "large.png"
    with large.open("wb") as file:
        file.truncate(2**31)  # a hole, which takes no room
    with pytest.raises(PictureError, match=r"large\.png: more than 1024 MB, too large for a picture"):
        read_picture(large)
