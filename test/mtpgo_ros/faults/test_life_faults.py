# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Models, transitions, parameters and signals that come at the wrong moment, over real DDS."""

import dataclasses
import random
import signal
import time

import pytest
from fault_harness import ERROR, LIMIT_S, OK, WARN
from fault_tools import (
    TRANSITIONS,
    HealthListener,
    Resources,
    Stranger,
    change_state,
    reconnected,
    set_parameters,
    set_together,
    sources,
    state_of,
    swap_model,
    swap_models,
)
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from ros_helpers import Process, traffic
from tiny_model import write_tiny_model

from mtpgo_core.schema import Source
from mtpgo_core.task.task_description import HistoryConfig
from mtpgo_ros.parameters.predictor_parameters import PredictorParameters

NEXT_STATE = {
    ("unconfigured", "configure"): "inactive",
    ("inactive", "activate"): "active",
    ("inactive", "cleanup"): "unconfigured",
    ("active", "deactivate"): "inactive",
}
"""The transitions that are allowed; all others must be refused and change nothing."""


@pytest.fixture(scope="module")
def node(start_predictor):
    """The predictor of this module."""
    node = start_predictor(input_timeout=0.5)
    node.healthy(steps=3)
    return node


@pytest.fixture(scope="module", autouse=True)
def before(node):
    """Threads and memory of the predictor at the start."""
    return Resources(node)


@pytest.fixture(scope="module")
def other_model(tmp_path_factory):
    """Another usable model."""
    return write_tiny_model(tmp_path_factory.mktemp("other") / "other.pt", name="other")


def model_of(node):
    """Return name and file of the model that the parameters and the diagnostics state."""
    request = GetParameters.Request(names=["model"])
    parameter = node.call(GetParameters, "get_parameters", request).values[0].string_value
    node.settle()
    values = {pair.key: pair.value for pair in node.statuses["model"].values}
    return parameter, values["model"], values["file"]


def model_predicts(node):
    """Wait until the model, not constant velocity on a busy machine, predicts every agent."""
    node.until(lambda: (node.healthy().source == Source.MODEL).all(), "the model")


def test_a_swap_of_the_model_loses_no_cycle(node, models, other_model):
    node.fresh().healthy()
    assert set_parameters(node, rate=20.0)[0].successful
    stamps, first = [], len(node.answers)
    next_s = time.monotonic()
    results = []
    for model in (other_model, models["quick"]):
        (answer,) = swap_models(node, model)
        end_s = time.monotonic() + LIMIT_S
        while not answer.done() or len(stamps) % 20:
            assert time.monotonic() < end_s
            node.time_s = round(node.time_s + 0.05, 6)  # 20 Hz, every one of them due
            states = traffic(node.time_s)
            stamps.append(states.stamp_ns)
            node.send(states)
            next_s = max(next_s + 0.05, time.monotonic())
            node.spin_for(next_s - time.monotonic())
            # Of several that wait, as after a pause of the machine, only the newest is predicted.
            node.answer(states.stamp_ns)
        results.append(answer.result().result)
    assert [result.successful for result in results] == [True, True], results
    assert "the model is now other" in results[0].reason
    answered = [a.prediction.stamp_ns for a in node.answers[first:]]
    assert sorted(answered) == stamps  # each of them once
    sources(node, first)  # finite and definite, also where constant velocity was quicker
    assert model_of(node)[1:] == ("tiny", str(models["quick"]))
    assert set_parameters(node, rate=5.0)[0].successful
    model_predicts(node)


def test_a_swapped_model_is_the_nodes_parameter(node, models, other_model):
    assert swap_model(node, other_model).successful
    assert model_of(node) == (str(other_model), "other", str(other_model))
    # It stays the model of the next configuration.
    for transition in ("deactivate", "cleanup", "configure", "activate"):
        assert change_state(node, transition)
    reconnected(node)
    assert model_of(node)[1] == "other"
    assert swap_model(node, models["quick"]).successful


def bad_models(folder, good):
    """Return files that are no usable models."""
    history = dataclasses.replace(HistoryConfig(), steps=8)
    files = {
        "truncated": good.read_bytes()[:2000],
        "empty": b"",
        "text": b"a model\n",
        "pickle": b"\x80\x04\x95\x05\x00\x00\x00\x00\x00\x00\x00\x8c\x01a\x94.",
    }
    for name, content in files.items():
        (folder / f"{name}.pt").write_bytes(content)
    return {
        "missing": folder / "no_such_model.pt",
        "folder": folder,
        "name": "no_such_name",
        "another history": write_tiny_model(folder / "history.pt", history=history),
        **{name: folder / f"{name}.pt" for name in files},
    }


@pytest.mark.parametrize(
    "kind",
    ["missing", "folder", "name", "another history", "truncated", "empty", "text", "pickle"],
)
def test_a_swap_to_a_file_that_is_no_usable_model(node, models, tmp_path, kind):
    node.fresh().healthy()
    wrong = bad_models(tmp_path, models["quick"])[kind]
    result = swap_model(node, wrong)
    assert not result.successful
    assert "the model was not swapped" in result.reason
    assert ("history" if kind == "another history" else str(wrong)) in result.reason
    assert "\n" not in result.reason
    model_predicts(node)
    assert model_of(node) == (str(models["quick"]), "tiny", str(models["quick"]))


def test_a_swap_with_other_parameters_or_at_the_wrong_moment(node, other_model):
    result = set_together(node, "swap_model", model=str(other_model), rate=1.0)
    assert not result.successful
    assert "rate" in result.reason
    first, second = swap_models(node, other_model, other_model)
    node.until(lambda: first.done() and second.done(), "both answers")
    reasons = [
        f.result().result.reason for f in (first, second) if not f.result().result.successful
    ]
    assert len(reasons) == 1
    assert "under way" in reasons[0]
    assert change_state(node, "deactivate")
    assert change_state(node, "cleanup")
    result = swap_model(node, other_model)
    assert not result.successful
    assert "unconfigured" in result.reason
    assert change_state(node, "configure")
    assert change_state(node, "activate")
    reconnected(node)


@pytest.mark.parametrize("transition", [1, 2, 3, 5, 6, 8, 10, 60, 77, 255])
def test_an_invalid_transition(node, transition):
    assert state_of(node) == "active"
    assert not change_state(node, transition)
    assert state_of(node) == "active"
    node.healthy()


@pytest.mark.parametrize("label", ["configure", "explode", "transition_success"])
def test_an_invalid_transition_by_its_label(node, label):
    assert not change_state(node, 0, label)
    assert state_of(node) == "active"


def test_transitions_in_random_order(node):
    drawn, state = random.Random(7), "active"
    for _ in range(40):
        transition = drawn.choice(sorted(TRANSITIONS))
        after = NEXT_STATE.get((state, transition))
        assert change_state(node, transition) == (after is not None), (state, transition)
        state = after or state
        assert state_of(node) == state
    while state != "active":
        transition = {"unconfigured": "configure", "inactive": "activate"}[state]
        assert change_state(node, transition)
        state = NEXT_STATE[state, transition]
    reconnected(node)
    node.fresh().healthy()
    node.level_while_healthy("input", OK)


def test_a_configuration_that_fails(node, models):
    health = HealthListener(node)
    assert change_state(node, "deactivate")
    health.becomes(WARN, "not active (inactive)")
    assert change_state(node, "cleanup")
    health.becomes(WARN, "not active (unconfigured)")
    good = str(models["quick"])
    assert set_parameters(node, model="/no/such/model.pt")[0].successful
    assert not change_state(node, "configure")
    health.becomes(ERROR, "/no/such/model.pt")
    node.level("model", ERROR, "/no/such/model.pt")
    assert set_parameters(node, model=good)[0].successful
    assert change_state(node, "configure")
    assert change_state(node, "activate")
    reconnected(node)
    node.level_while_healthy("input", OK)

    def recovered():
        """A busy machine may still be late."""
        node.healthy()
        values = {pair.key: pair.value for pair in health.heard[-1].values}
        return values["state"] == "active" and values["cause"] in ("", "timing")

    node.until(recovered, "health")


NONSENSE = (True, -1, 10**12, float("nan"), float("inf"), "nonsense", ["a", "b"], [True], [0.5])


def is_allowed(field, value):
    """Return whether a parameter may have a value of :data:`NONSENSE` while the node is active."""
    return (type(value) is bool and type(field.default) is bool) or (
        field.name in ("ego_id", "lane_frame") and type(value) in (str, int)
    )


def test_parameters_to_nonsense_one_by_one(node):
    node.fresh().healthy()
    for field in dataclasses.fields(PredictorParameters):
        nonsense = [value for value in NONSENSE if not is_allowed(field, value)]
        request = SetParameters.Request(
            parameters=[Parameter(field.name, value=v).to_parameter_msg() for v in nonsense]
        )
        results = node.call(SetParameters, "set_parameters", request).results
        for value, result in zip(nonsense, results, strict=True):
            assert not result.successful, f"{field.name} = {value!r}"
            assert result.reason, f"{field.name} = {value!r}"
    node.healthy(steps=2)


def test_parameters_to_nonsense_as_a_set(node):
    result = set_together(node, max_agents=7, radius=-1.0)
    assert not result.successful
    assert "radius" in result.reason
    result = set_together(node, max_agents=7, modell="x")
    assert not result.successful
    request = GetParameters.Request(names=["max_agents", "radius"])
    agents, radius = node.call(GetParameters, "get_parameters", request).values
    assert (agents.integer_value, radius.double_value) == (128, 0.0)
    node.healthy()


def test_a_second_node_of_the_same_name(node):
    node.fresh().healthy()
    other = Stranger(node.namespace, "predictor")
    said = node.level_while_healthy("input", WARN, "another node")
    assert f"{node.namespace}/predictor" in said.message
    other.close()
    node.level_while_healthy("input", OK)


def test_threads_and_memory_are_as_before(node, before):
    node.healthy()
    before.check()


def test_sigkill_while_predicting_and_a_restart(node, models):
    node.healthy()
    node.process.popen.send_signal(signal.SIGKILL)
    assert node.process.finish()[0] == -signal.SIGKILL
    arguments = ("--ros-args", "-r", f"__ns:={node.namespace}", "-p", f"model:={models['quick']}")
    node.process = Process("predictor", *arguments, "-p", "diagnostic_period:=0.1")
    node.process.wait_for("hearing", node.spin)
    node.process.wait_for("heard by", node.spin)
    reconnected(node)
    node.fresh().healthy(steps=2)
    # The name of the killed one is still known for a while, which is said.
    node.until(lambda: node.statuses["input"].level in (OK, WARN), "no error")


def test_a_node_that_was_shut_down_says_so_and_still_ends(node):
    health = HealthListener(node)
    assert change_state(node, 7)  # from active
    health.becomes(ERROR, "finalized")
    node.level("input", ERROR, "has to be started again")
    for transition in TRANSITIONS:
        assert not change_state(node, transition)
    status, _, err = node.process.interrupt(signal.SIGTERM)
    assert (status, "Traceback" in err) == (0, False)
