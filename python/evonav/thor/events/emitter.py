"""Encode the engine's answer to an action as the fields of one message."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from evonav.errors import EvonavError
from evonav.thor.engine import Engine, Result, log_once
from evonav.thor.events import images
from evonav.thor.events.images import ImageKinds, palette_of
from evonav.thor.events.metadata import pack_event, patch
from evonav.thor.scene import Scene
from evonav.thor.transport.fifo import Field, FieldType
from evonav.world.camera import Images


class Emitter:
    """Encodes the events of one engine; what has not changed since the last event is reused."""

    def __init__(self, engine: Engine, *, has_camera: bool = True, has_patches: bool = True) -> None:
        """Emit events for an engine.

        Args:
            engine: The engine whose state the events show.
            has_camera: `False` for a client that asked for no graphics.
            has_patches: Whether the transport supports messages that contain only the changes.
        """
        self._engine = engine
        self._has_camera = has_camera
        self._has_patches = has_patches
        self._sequence_id = -1
        self._state: object = None
        self._images: list[Field] = []

    def event(self, message: Mapping[str, Any]) -> list[Field]:
        """Return the event that answers a message which the engine has executed."""
        sequence_id = message.get("sequenceId")
        self._sequence_id = (
            sequence_id if type(sequence_id) is int and abs(sequence_id) < 2**62 else self._sequence_id + 1
        )
        try:
            return self._event(message)
        except Exception as error:
            # The scene's house cannot be described. The client is informed and may load another house.
            problem = f"the engine cannot show the scene: {type(error).__name__}: {error}"
            if not isinstance(error, EvonavError):
                log_once(error, problem)
            self._engine.scene = Scene(self._engine.scene.name)
            self._engine.cameras.clear()
            self._engine.map_view = None
            self._engine.last = Result(self._engine.last.action, False, problem)
            return self._event(message)

    def _event(self, message: Mapping[str, Any]) -> list[Field]:
        engine = self._engine
        kinds = self._kinds(message)
        state = (engine.state, kinds)
        if self._has_patches and engine.settings.fastActionEmit and state == self._state:
            return [(FieldType.METADATA_PATCH, patch(engine.last))]
        if state != self._state:
            self._images = self._rendered(kinds) if kinds else []
            self._state = state
        has_colors = kinds is not None and kinds.needs_instances
        metadata = pack_event(engine, sequence_id=self._sequence_id, has_colors=has_colors)
        return [(FieldType.METADATA, metadata), *self._images]

    def _kinds(self, message: Mapping[str, Any]) -> ImageKinds | None:
        """Return the images to send with this event; `None` for none."""
        if not self._has_camera or not message.get("renderImage", True):
            return None
        settings = self._engine.settings
        return ImageKinds(
            rgb=True,
            depth=settings.renderDepthImage,
            # An action may request these two images for its own event only.
            instances=settings.renderInstanceSegmentation or message.get("renderInstanceSegmentation") is True,
            classes=settings.renderSemanticSegmentation or message.get("renderSemanticSegmentation") is True,
        )

    def _rendered(self, kinds: ImageKinds) -> list[Field]:
        engine = self._engine
        palette = engine.scene.derived(palette_of)
        views: list[Callable[..., Images]] = [engine.view]
        views += [partial(camera.render, engine.scene) for camera in engine.cameras]
        fields: list[Field] = []
        for index, render in enumerate(views):
            if engine.scene.house is None:
                seen = images.blank(engine.width_px, engine.height_px)
            else:
                seen = render(rgb=kinds.rgb, instances=kinds.needs_instances)
            fields += images.encode(seen, kinds, palette, is_third_party=index > 0)
        return fields
