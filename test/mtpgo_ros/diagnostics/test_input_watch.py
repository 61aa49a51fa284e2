# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The age of the input, by clocks that the test sets."""

import pytest

from mtpgo_ros.diagnostics.input_watch import CLOCK_PATIENCE, InputWatch

TIMEOUT_S = 1.0


class ManualClock:
    """A clock that the test moves."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return ManualClock()


@pytest.fixture
def watch(clock):
    return InputWatch(clock)


def test_only_usable_observations_are_a_sign_of_life(watch, clock):
    clock.now += 2.0
    watch.reject("no stamp")
    age = watch.age(TIMEOUT_S)
    assert (age.usable, age.age_s, age.rejected, age.reason) == (False, 2.0, 1, "no stamp")
    watch.accept()
    clock.now += 0.5
    watch.reject("nan")
    watch.reject("late")
    age = watch.age(TIMEOUT_S)
    assert (age.usable, age.age_s, age.rejected, age.reason) == (True, 0.5, 2, "late")
    watch.start()
    assert watch.age(TIMEOUT_S) == InputWatch(clock).age(TIMEOUT_S)


def test_a_slow_simulation_does_not_make_the_input_stale(watch, clock):
    watch.set_simulated_time(5_000_000_000)
    watch.accept()
    for step in range(1, 11):  # a tenth of real time
        clock.now += 1.0
        watch.set_simulated_time(5_000_000_000 + step * 100_000_000)
    age = watch.age(TIMEOUT_S)
    assert age.age_s == pytest.approx(1.0)
    assert age.clock_stands_s == 0.0


def test_a_clock_that_stands_still_is_waited_for_and_then_replaced(watch, clock):
    watch.set_simulated_time(5_000_000_000)
    watch.accept()
    clock.now += CLOCK_PATIENCE * TIMEOUT_S
    watch.set_simulated_time(5_000_000_000)
    age = watch.age(TIMEOUT_S)
    assert (age.age_s, age.clock_stands_s, age.clock_seen) == (0.0, 3.0, True)
    clock.now += 0.5
    assert watch.age(TIMEOUT_S).age_s == 3.5
    # It moves again: time counts on it, as before.
    watch.set_simulated_time(5_100_000_000)
    age = watch.age(TIMEOUT_S)
    assert (age.age_s, age.clock_stands_s) == (pytest.approx(0.1), 0.0)


def test_a_clock_that_never_came(watch, clock):
    watch.set_simulated_time(0)
    watch.accept()
    clock.now += 2.0
    watch.set_simulated_time(0)
    age = watch.age(TIMEOUT_S)
    assert (age.clock_seen, age.clock_stands_s, age.age_s) == (False, 2.0, 0.0)
    clock.now += 2.0
    assert watch.age(TIMEOUT_S).age_s == 4.0
    watch.set_simulated_time(9_000_000_000)  # it comes: what was before does not count on it
    assert watch.age(TIMEOUT_S).age_s == 0.0


def test_a_jump_back_of_the_clock_gives_no_negative_age(watch, clock):
    watch.set_simulated_time(50_000_000_000)
    watch.accept()
    clock.now += 0.2
    watch.set_simulated_time(1_000_000_000)
    assert watch.age(TIMEOUT_S).age_s == 0.0


@pytest.mark.parametrize("back_ns", [1, 1_000_000_000, 3600_000_000_000])
def test_silence_after_a_jump_back_of_the_clock_is_noticed(watch, clock, back_ns):
    start_ns = 7200_000_000_000
    watch.set_simulated_time(start_ns)
    watch.accept()
    for step in range(1, 31):  # 0.5 s until the jump, then silence
        clock.now += 0.1
        jumped_ns = back_ns if step > 5 else 0
        watch.set_simulated_time(start_ns + step * 100_000_000 - jumped_ns)
    # The step of the clock in which it was set back may be lost, no more.
    assert 2.9 - 1e-6 <= watch.age(TIMEOUT_S).age_s <= 3.0 + 1e-6
    watch.accept()
    assert watch.age(TIMEOUT_S).age_s == 0.0


def test_a_jump_forward_of_the_clock_does_not_make_the_input_stale(watch, clock):
    watch.set_simulated_time(7200_000_000_000)
    watch.accept()
    clock.now += 0.1
    watch.set_simulated_time(10800_000_000_000)
    assert watch.age(TIMEOUT_S).age_s == pytest.approx(0.1)


def test_another_clock_while_running(watch, clock):
    watch.accept()
    clock.now += 0.5
    watch.set_simulated_time(7_000_000_000)
    watch.set_simulated_time(7_200_000_000)
    assert watch.age(TIMEOUT_S).age_s == pytest.approx(0.2)
    clock.now += 2.0
    watch.set_simulated_time(None)
    age = watch.age(TIMEOUT_S)
    assert (age.age_s, age.clock_stands_s) == (2.5, 0.0)
