# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Typestores, message makers and the three independent CDR decoders that the tests share."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from msg_adapters.types import RclpyTypes, TypestoreTypes
from msg_adapters.wire.definitions import DEFINITIONS
from mtpgo_core.identity import keys_from_integers
from mtpgo_core.schema import Prediction, TrackedStates, tracked_states


@pytest.fixture(scope="session")
def typestore() -> Any:
    """Jazzy's own types and the third-party ones."""
    store = get_typestore(Stores.ROS2_JAZZY)
    new = {}
    for name, text in DEFINITIONS.items():
        new.update(get_types_from_msg(text, name))
    store.register(new)
    return store


@pytest.fixture(scope="session")
def offline(typestore: Any) -> TypestoreTypes:
    return TypestoreTypes(typestore)


@pytest.fixture(scope="session")
def online() -> RclpyTypes:
    pytest.importorskip("rclpy")
    return RclpyTypes()


@pytest.fixture(scope="session")
def decoded(typestore: Any) -> Callable[..., dict[str, Any]]:
    """A message's CDR bytes as rosbags writes them, read by every decoder that can."""

    def decode(message: Any, name: str, *, with_rclpy: bool = False) -> dict[str, Any]:
        data = bytes(typestore.serialize_cdr(message, name))
        text, _ = typestore.generate_msgdef(name, ros_version=2)
        schema = Schema(id=1, name=name, encoding="ros2msg", data=text.encode())
        mcap_decoder = DecoderFactory().decoder_for("cdr", schema)
        assert mcap_decoder is not None
        found = {
            "rosbags": typestore.deserialize_cdr(data, name),
            "mcap": mcap_decoder(data),
        }
        if with_rclpy:
            serialization = pytest.importorskip("rclpy.serialization")
            found["rclpy"] = serialization.deserialize_message(
                data, RclpyTypes().message_class(name)
            )
        return found

    return decode


@pytest.fixture(scope="session")
def assert_equal() -> Callable[..., None]:
    """Compares all that two TrackedStates say, NaN being equal to NaN."""

    def compare(found: TrackedStates, wanted: TrackedStates, rtol: float = 1e-6) -> None:
        assert found.stamp_ns == wanted.stamp_ns
        assert found.frame_id == wanted.frame_id
        for name in ("key", "agent_class"):
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), name)
        for name in ("position", "z", "velocity", "acceleration", "yaw", "size", "covariance"):
            np.testing.assert_allclose(
                getattr(found, name), getattr(wanted, name), rtol=rtol, atol=1e-6, err_msg=name
            )

    return compare


@pytest.fixture
def states() -> TrackedStates:
    """Five road users with every field known, numbers that float32 does not hold exactly."""
    rng = np.random.default_rng(7)
    n = 5
    root = rng.normal(size=(n, 4, 4))
    return tracked_states(
        1_700_000_000_123_456_789,
        "map",
        keys_from_integers([1, 2, 17, 2**31 - 1, 3]),
        rng.normal(scale=200.0, size=(n, 2)),
        agent_class=np.array([1, 2, 7, 6, 5], dtype=np.uint8),
        z=rng.normal(size=n),
        velocity=rng.normal(scale=15.0, size=(n, 2)),
        acceleration=rng.normal(size=(n, 2)),
        yaw=rng.uniform(-np.pi, np.pi, size=n),
        size=rng.uniform(0.5, 12.0, size=(n, 2)),
        covariance=root @ np.swapaxes(root, 1, 2) + np.eye(4),
    )


@pytest.fixture
def prediction() -> Prediction:
    """Three agents, four modes, five steps, as the core hands them over."""
    rng = np.random.default_rng(3)
    n, modes, steps = 3, 4, 5
    weight = np.sort(rng.dirichlet(np.ones(modes), size=n), axis=1)[:, ::-1]
    root = rng.normal(size=(n, modes, steps, 2, 2))
    return Prediction(
        stamp_ns=1_700_000_000_123_456_789,
        frame_id="map",
        key=rng.integers(0, 2**32, size=(n, 4), dtype=np.uint32),
        agent_class=np.array([1, 7, 2], dtype=np.uint8),
        z=np.array([0.5, -1.0, 2.0]),
        size=np.array([[4.5, 1.8], [0.6, 0.5], [12.0, 2.5]]),
        initial=rng.normal(scale=20.0, size=(n, 4)),
        initial_yaw=rng.uniform(-3.0, 3.0, size=n),
        time_s=0.2 * np.arange(1, steps + 1),
        weight=weight,
        mean=rng.normal(scale=50.0, size=(n, modes, steps, 4)),
        yaw=rng.uniform(-3.0, 3.0, size=(n, modes, steps)),
        covariance=root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(2),
        source=np.array([0, 1, 0], dtype=np.uint8),
        sigma_factor_50=rng.uniform(0.5, 1.0, size=(n, steps)),
        calibration=np.array([2, 2, 1], dtype=np.uint8),
    )
