"""The WSGI transport against the client's own server, `ai2thor.wsgi_server.WsgiServer`."""

import json
import threading
import time

import msgpack
import numpy as np
import pytest

from evonav.thor.transport.fifo import ClientGone, FieldType, FramingError
from evonav.thor.transport.wsgi import Wsgi, is_loopback

wsgi_server = pytest.importorskip("ai2thor.wsgi_server", reason="ai2thor is not installed (group `thor`)")

WIDTH, HEIGHT = 8, 6


@pytest.fixture
def server():
    server = wsgi_server.WsgiServer("127.0.0.1", timeout=10.0, width=WIDTH, height=HEIGHT)
    server.client_token = "a-token"
    server.start()
    yield server
    server.wsgi_server.shutdown()
    server.wsgi_server.server_close()


@pytest.fixture
def connect(server):
    made = []

    def connect(token="a-token", is_orphan=lambda: False) -> Wsgi:
        params = server.unity_params()
        made.append(Wsgi(params["host"], int(params["port"]), token, is_orphan))
        return made[-1]

    yield connect
    for transport in made:
        transport.close()


def _metadata(sequence_id: int, cameras: int = 0) -> bytes:
    agent = {
        "screenWidth": WIDTH,
        "screenHeight": HEIGHT,
        "sceneName": "Procedural",
        "lastAction": "Pass",
        "lastActionSuccess": True,
        "actionReturn": {"text": 'Grüße, "quoted"\r\n', "number": 0.1},
        "colors": [{"name": "Bowl|1", "color": [1, 2, 3]}],
        "objects": [],
        "thirdPartyCameras": [{} for _ in range(cameras)],
        "depthFormat": "Meters",
    }
    return msgpack.packb({"agents": [agent], "sequenceId": sequence_id, "activeAgentId": 0})


def _images(number: int) -> dict[FieldType, np.ndarray]:
    random = np.random.default_rng(number)
    pixels = random.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8)
    return {
        FieldType.RGB_IMAGE: np.ascontiguousarray(pixels[..., :3]),
        FieldType.DEPTH_IMAGE: random.random((HEIGHT, WIDTH), dtype=np.float32),
        FieldType.IDS_IMAGE: pixels,
        FieldType.CLASSES_IMAGE: pixels[::-1].copy(),
    }


def test_events_and_actions_go_back_and_forth(server, connect) -> None:
    transport = connect()
    images = _images(0)
    for sequence_id in range(3):
        transport.send([(FieldType.METADATA, _metadata(sequence_id)), *images.items()])
        event = server.receive()
        np.testing.assert_array_equal(event.frame, images[FieldType.RGB_IMAGE][::-1])
        np.testing.assert_array_equal(event.depth_frame, images[FieldType.DEPTH_IMAGE][::-1])
        np.testing.assert_array_equal(event.instance_segmentation_frame, images[FieldType.IDS_IMAGE][::-1, :, :3])
        np.testing.assert_array_equal(event.semantic_segmentation_frame, images[FieldType.CLASSES_IMAGE][::-1, :, :3])
        assert event.metadata["actionReturn"] == {"text": 'Grüße, "quoted"\r\n', "number": 0.1}
        server.send({"action": "MoveAhead", "note": "Grüße", "sequenceId": sequence_id + 1})
        assert json.loads(transport.receive()) == {
            "action": "MoveAhead",
            "note": "Grüße",
            "sequenceId": sequence_id + 1,
        }


def test_any_text_arrives(server, connect) -> None:
    """Half a surrogate pair is JSON, and so may be in a house."""
    text = "\ud800 Grüße \U0001f600"
    packed = msgpack.packb(
        {"agents": [msgpack.unpackb(_metadata(0))["agents"][0] | {"errorMessage": text}], "sequenceId": 0},
        unicode_errors="surrogatepass",
    )
    connect().send([(FieldType.METADATA, packed)])
    assert server.receive().metadata["errorMessage"] == text
    server.send({})


def test_third_party_images_are_in_order(server, connect) -> None:
    transport = connect()
    pairs = []
    cameras = [_images(1), _images(2)]
    for images in cameras:
        pairs += [
            (FieldType.THIRD_PARTY_IMAGE, images[FieldType.RGB_IMAGE]),
            (FieldType.THIRD_PARTY_DEPTH, images[FieldType.DEPTH_IMAGE]),
            (FieldType.THIRD_PARTY_IMAGE_IDS, images[FieldType.IDS_IMAGE]),
            (FieldType.THIRD_PARTY_CLASSES, images[FieldType.CLASSES_IMAGE]),
        ]
    transport.send([(FieldType.METADATA, _metadata(0, cameras=2)), *pairs])
    event = server.receive()
    for k, images in enumerate(cameras):
        np.testing.assert_array_equal(event.third_party_camera_frames[k], images[FieldType.RGB_IMAGE][::-1])
        np.testing.assert_array_equal(event.third_party_depth_frames[k], images[FieldType.DEPTH_IMAGE][::-1])
        np.testing.assert_array_equal(
            event.third_party_instance_segmentation_frames[k], images[FieldType.IDS_IMAGE][::-1, :, :3]
        )
    server.send({})


def test_another_engines_token_is_refused(server, connect) -> None:
    transport = connect(token="another")
    transport.send([(FieldType.METADATA, _metadata(0))])
    with pytest.raises(FramingError, match="HTTP 403"):
        transport.receive()


def test_stop_is_distinguished_from_an_action(server, connect) -> None:
    transport = connect()
    transport.send([(FieldType.METADATA, _metadata(0))])
    server.receive()
    server.send({})
    with pytest.raises(ClientGone, match="stopped"):
        transport.receive()


def test_waiting_ends_with_the_parent(server, connect) -> None:
    """Something else keeps the connection open, but the process that started the engine is gone."""
    orphaned = threading.Event()
    transport = connect(is_orphan=orphaned.is_set)
    transport.send([(FieldType.METADATA, _metadata(0))])
    server.receive()
    threading.Timer(0.2, orphaned.set).start()
    began_s = time.monotonic()
    with pytest.raises(ClientGone):
        transport.receive()
    assert time.monotonic() - began_s < 3.0
    server.send({})


def test_a_missing_reader_is_an_error() -> None:
    with pytest.raises(ClientGone, match="takes no event"):
        Wsgi("127.0.0.1", 9, "t", lambda: False).send([(FieldType.METADATA, _metadata(0))])


@pytest.mark.parametrize(
    "host", ["10.0.0.1", "0.0.0.0", "example.org", "192.168.1.2", "::", "", "localhost.example.org"]
)
def test_other_machines_are_refused(host) -> None:
    with pytest.raises(ValueError, match="is not on this machine"):
        Wsgi(host, 80, "t", lambda: False)


def test_addresses_of_this_machine_are_accepted() -> None:
    assert all(is_loopback(host) for host in ("127.0.0.1", "127.3.2.1", "::1", "localhost"))


def test_the_controller_drives_the_engine_over_either_transport_alike(start_controller, house) -> None:
    """Metadata and images of the same steps, over pipes and over HTTP."""
    options = {"scene": house, "width": 64, "height": 48}
    images = {"renderDepthImage": True, "renderInstanceSegmentation": True, "renderSemanticSegmentation": True}
    pipes = start_controller(**options, **images)
    http = start_controller(**options, **images, server_class=wsgi_server.WsgiServer)
    assert type(http.server) is not type(pipes.server)
    for action in ("Pass", "MoveAhead", "RotateRight", "NoSuchMove", "Pass", "GetReachablePositions"):
        if action == "NoSuchMove":
            for controller in (pipes, http):
                with pytest.raises(ValueError, match=action):
                    controller.step(action)
            continue
        expected, got = pipes.step(action), http.step(action)
        assert dict(got.metadata) == dict(expected.metadata)
        for name in ("frame", "depth_frame", "instance_segmentation_frame", "semantic_segmentation_frame"):
            np.testing.assert_array_equal(getattr(got, name), getattr(expected, name))
    reset = http.reset(scene=house)
    assert reset.metadata["lastActionSuccess"]


def test_the_engine_ends_with_its_http_client(start_controller, house) -> None:
    controller = start_controller(scene=house, server_class=wsgi_server.WsgiServer)
    process = controller.server.unity_proc
    controller.server.send({})  # what `stop` says before it kills
    assert process.wait(5) == 0
