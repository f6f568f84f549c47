"""The animation at the top of the README: a drive past the row as `pomona scan` sees it, then its season in the page.

    python examples/animation.py out/demo

takes the folder that `pomona demo examples/row` made, scans the last visit once more for its preview, and films the
report in Debian's chromium. Nothing is drawn but captions. Writes docs/images/season.webp.
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import av
import matplotlib
from PIL import Image, ImageDraw, ImageFont

from pomona.recording import open_recording
from pomona.scanning import scan
from pomona.survey.preview import write_preview

ROOT = Path(__file__).parents[1]
OUTPUT = ROOT / "docs" / "images" / "season.webp"
VISIT = ROOT / "examples" / "row" / "2024-09-12" / "row.mp4"

SIZE_PX = (800, 500)
CAPTION_PX = 34
QUALITY = 50
PREVIEW_EVERY, PREVIEW_MS = 3, 200
"""Every third of ten frames a second."""

CHROMIUM = "/usr/bin/chromium"
CHROMIUM_FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox")
PAGE_PX = {"width": 1240, "height": 722}
DAYS_A_FRAME, PAGE_MS, LAST_MS = 3, 180, 2500


def main(arguments: list[str]) -> None:
    """Put the pictures of both parts together."""
    (demo,) = map(Path, arguments)
    frames = [
        (captioned(picture, "The scan: every fruit found, followed and measured"), PREVIEW_MS) for picture in preview()
    ]
    caption = "The season: one identity for each fruit, its growth, what to do"
    frames += [(captioned(picture, caption), PAGE_MS) for picture in season(demo / "report.html")]
    pictures, durations = zip(*frames, strict=True)
    durations = [*durations[:-1], LAST_MS]
    first, *others = pictures
    first.save(OUTPUT, save_all=True, append_images=others, duration=durations, loop=0, quality=QUALITY, method=6)
    sys.stdout.write(f"{OUTPUT}: {len(pictures)} frames, {OUTPUT.stat().st_size / 1e6:.2f} MB\n")


def preview() -> Iterator[Image.Image]:
    """Give frames of the preview of a scan."""
    recording = open_recording(VISIT)
    survey = scan(recording)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "seen.mp4"
        write_preview(path, recording, survey)
        with av.open(str(path)) as video:
            for number, frame in enumerate(video.decode(video=0)):
                if number % PREVIEW_EVERY == 0:
                    yield frame.to_image()


def season(report: Path) -> Iterator[Image.Image]:
    """Give pictures of the page while its slider goes from the first visit to the harvest."""
    import io

    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(CHROMIUM_FLAGS))
        page = browser.new_page(viewport=PAGE_PX)
        page.goto(report.resolve().as_uri())
        for name in ("Size", "Side"):
            page.get_by_role("button", name=name, exact=True).click()
        slider = page.get_by_label("Date", exact=True).and_(page.locator("input"))
        last = int(slider.get_attribute("max") or 0)
        for day in [*range(0, last, DAYS_A_FRAME), last]:
            slider.fill(str(day))
            slider.blur()
            page.wait_for_timeout(300)
            yield Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()


def captioned(picture: Image.Image, caption: str) -> Image.Image:
    """Fit a picture into the frame, with a line of text below."""
    width, height = SIZE_PX
    framed = Image.new("RGB", SIZE_PX, "#f6f5f1")
    room = height - CAPTION_PX
    scaled = picture.resize((width, round(width * picture.height / picture.width)), Image.Resampling.LANCZOS)
    framed.paste(scaled.crop((0, 0, width, min(room, scaled.height))), (0, max(0, room - scaled.height) // 2))
    font = ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", 17)
    ImageDraw.Draw(framed).text((width / 2, height - CAPTION_PX / 2), caption, fill="#23261f", font=font, anchor="mm")
    return framed


if __name__ == "__main__":
    main(sys.argv[1:])
