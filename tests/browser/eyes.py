"""How a test looks at a page: where a point of the scene is on screen, which colours a picture holds, what went wrong."""

import io
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np
from PIL import Image
from playwright.sync_api import Page

ARGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-dev-shm-usage",
]


def project(camera, point_m, width: float, height: float) -> tuple[float, float]:
    """Return the pixel of a point (3,), m, in a view of the size: a pinhole looking from position to look_at."""
    position, target, up = (np.asarray(v, dtype=float) for v in (camera.position, camera.look_at, camera.up_direction))
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    d = np.asarray(point_m) - position
    focal = height / 2.0 / np.tan(camera.fov / 2.0)
    return width / 2 + focal * (d @ right) / (d @ forward), height / 2 + focal * (d @ down) / (d @ forward)


def until(page: Page, holds, seconds: float = 60.0, what: str = "it") -> None:
    """Wait until a condition holds, letting the page live meanwhile."""
    for _ in range(int(seconds * 20)):
        if holds():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{what} did not happen within {seconds} s")


def picture(page: Page, selector: str | None = None) -> np.ndarray:
    """Return a screenshot (h, w, 3) uint8 of the page or of one element."""
    data = page.locator(selector).screenshot() if selector else page.screenshot()
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def near(image: np.ndarray, rgb, within: int = 12) -> float:
    """Return the share of pixels whose every channel is near a colour."""
    return float((np.abs(image.astype(int) - np.asarray(rgb, dtype=int)).max(axis=-1) <= within).mean())


def bluish(image: np.ndarray) -> float:
    """Return the share of pixels that are clearly more blue than red."""
    i = image.astype(int)
    return float((i[..., 2] - i[..., 0] > 40).mean())


def reddish(image: np.ndarray) -> float:
    """Return the share of pixels that are clearly more red than blue."""
    i = image.astype(int)
    return float((i[..., 0] - i[..., 2] > 40).mean())


@dataclass
class Watch:
    """Everything a page complained about or asked of somebody else."""

    origin: str
    complaints: list[str] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)

    def on(self, page: Page) -> "Watch":
        page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda e: self.complaints.append(str(e)))
        page.on("request", lambda r: self._request(r.url))
        page.on("websocket", lambda w: self._request(w.url))
        return self

    def _request(self, url: str) -> None:
        if urlsplit(url).scheme in {"data", "blob"}:
            return
        if urlsplit(url).netloc != urlsplit(self.origin).netloc:
            self.foreign.append(url)
