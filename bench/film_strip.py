"""One PNG of several pictures with captions: what a camera saw while a rig moved.

    PYTHON bench/film_strip.py OUT.png [-width 320] [-columns 3] [-animate MILLISECONDS] PICTURE[=CAPTION]...

The pictures are those that `octoform look -save` wrote. PYTHON is the one of a serving environment whose server takes
pictures with OpenCV (`.octoform/<host>/environments/*/bin/python`). With -animate the pictures follow one another in an
animated PNG instead of standing side by side.
"""

import argparse
import sys
from typing import Any

import cv2
import numpy

BAND = 28
GAP = 6
DARK, BRIGHT = (32, 32, 32), (240, 240, 240)


def main() -> int:
    """Write the picture; 1 where one of the given files is none."""
    given = arguments()
    frames = []
    for item in given.pictures:
        path, _, caption = item.partition("=")
        picture = cv2.imread(path)
        if picture is None:
            print(f"film_strip: {path} is no picture", file=sys.stderr)
            return 1
        frames.append(captioned(picture, caption, given.width))
    tallest = max(frame.shape[0] for frame in frames)
    frames = [padded(frame, tallest, given.width) for frame in frames]
    written = (
        animated(given, frames)
        if given.animate
        else cv2.imwrite(given.out, strip(frames, given.columns), (cv2.IMWRITE_PNG_COMPRESSION, 9))
    )
    print(f"{given.out}: {len(frames)} pictures" if written else f"film_strip: {given.out} cannot be written")
    return 0 if written else 1


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", metavar="OUT.png")
    parser.add_argument("pictures", metavar="PICTURE[=CAPTION]", nargs="+")
    parser.add_argument("-width", type=int, default=320, help="of one picture, in pixels")
    parser.add_argument("-columns", type=int, default=3, help="pictures side by side")
    parser.add_argument("-animate", metavar="MILLISECONDS", type=int, help="how long each picture is shown")
    return parser.parse_args()


def captioned(picture: Any, caption: str, width: int) -> Any:
    """The picture at that width, with its caption in a dark band below."""
    height = round(picture.shape[0] * width / picture.shape[1])
    small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    band = numpy.full((BAND, width, 3), DARK, numpy.uint8)
    cv2.putText(band, caption, (8, BAND - 9), cv2.FONT_HERSHEY_SIMPLEX, 0.45, BRIGHT, 1, cv2.LINE_AA)
    return numpy.vstack([small, band])


def padded(frame: Any, height: int, width: int) -> Any:
    """The frame with white below it, so that all are as tall."""
    return numpy.vstack([frame, numpy.full((height - frame.shape[0], width, 3), 255, numpy.uint8)])


def strip(frames: list[Any], columns: int) -> Any:
    """The frames in rows, with a white gap between them."""
    height, width = frames[0].shape[:2]
    columns = max(1, min(columns, len(frames)))
    rows = -(-len(frames) // columns)
    sheet = numpy.full((rows * (height + GAP) - GAP, columns * (width + GAP) - GAP, 3), 255, numpy.uint8)
    for index, frame in enumerate(frames):
        top, left = index // columns * (height + GAP), index % columns * (width + GAP)
        sheet[top : top + height, left : left + width] = frame
    return sheet


def animated(given: argparse.Namespace, frames: list[Any]) -> bool:
    """The frames one after another, again and again."""
    film = cv2.Animation()
    film.frames = frames
    film.durations = numpy.full(len(frames), given.animate, numpy.int32)
    return bool(cv2.imwriteanimation(given.out, film))


if __name__ == "__main__":
    sys.exit(main())
