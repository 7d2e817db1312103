"""A webcam that looks at the simulated rig: the bench's camera, with the arm and the rail in its picture."""

from dataclasses import dataclass

from vm.devices.camera import Camera

from octoform.simulation.scene import Scene


@dataclass(kw_only=True)
class SceneCamera(Camera):
    """Every frame shows the scene as it is at that moment."""

    scene: Scene
    rate: int = 5

    def picture(self) -> bytes:
        """One frame in YUYV: of two neighbours in a line one pair of colours, in two lines the same."""
        light, blue, red = self.scene.frame(self.width, self.height)
        frame = bytearray(2 * self.width * self.height)
        frame[0::2] = light
        frame[1::4] = self._both_lines(blue)
        frame[3::4] = self._both_lines(red)
        return bytes(frame)

    def _both_lines(self, colours: bytes) -> bytes:
        half = self.width // 2
        return b"".join(2 * colours[start : start + half] for start in range(0, len(colours), half))
