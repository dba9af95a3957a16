"""Events: what the engine answers to an action, as fields of one message."""

from collections.abc import Mapping
from typing import Any

from evonav.errors import EvonavError
from evonav.thor.engine import Engine, Result, log_once
from evonav.thor.events import images
from evonav.thor.events.images import Kinds
from evonav.thor.events.metadata import MetadataEncoder, patch
from evonav.thor.scene import Scene
from evonav.thor.transport.fifo import Field, FieldType


class Emitter:
    """Makes the events of one engine. What has not changed since the last event is not made again."""

    def __init__(self, engine: Engine, *, has_camera: bool = True, has_patches: bool = True) -> None:
        """Emits for an engine.

        Args:
            engine: Whose events.
            has_camera: False for a client that asked for no graphics.
            has_patches: Whether the transport knows messages that only say what has changed.
        """
        self._engine = engine
        self._has_camera = has_camera
        self._has_patches = has_patches
        self._metadata = MetadataEncoder()
        self._sequence_id = -1
        self._state: object = None
        self._images: list[Field] = []

    def event(self, message: Mapping[str, Any]) -> list[Field]:
        """The answer to a message that the engine has executed."""
        asked = message.get("sequenceId")
        self._sequence_id = asked if type(asked) is int and abs(asked) < 2**62 else self._sequence_id + 1
        try:
            return self._event(message)
        except Exception as error:
            # The house of a scene that cannot be described: the client gets to know, and may load another.
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
        metadata = self._metadata.event(engine, sequence_id=self._sequence_id, has_colors=has_colors)
        return [(FieldType.METADATA, metadata), *self._images]

    def _kinds(self, message: Mapping[str, Any]) -> Kinds | None:
        """Images to send with this event; `None` for none."""
        if not self._has_camera or not message.get("renderImage", True):
            return None
        settings = self._engine.settings
        return Kinds(
            rgb=True,
            depth=settings.renderDepthImage,
            # Actions may ask for these two once.
            instances=settings.renderInstanceSegmentation or message.get("renderInstanceSegmentation") is True,
            classes=settings.renderSemanticSegmentation or message.get("renderSemanticSegmentation") is True,
        )

    def _rendered(self, kinds: Kinds) -> list[Field]:
        engine = self._engine
        if engine.scene.house is None:
            size = (engine.width_px, engine.height_px)
            fields = images.blank(*size, kinds)
            for _ in engine.cameras:
                fields += images.blank(*size, kinds, is_third_party=True)
            return fields
        palette = self._metadata.palette(engine.scene)
        frame = engine.view(rgb=kinds.rgb, instances=kinds.needs_instances)
        fields = images.encode(frame, kinds, palette)
        for camera in engine.cameras:
            seen = camera.render(engine.scene, rgb=kinds.rgb, instances=kinds.needs_instances)
            fields += images.encode(seen, kinds, palette, is_third_party=True)
        return fields
