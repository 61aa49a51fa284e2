# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Keeps a node out of Fast DDS's shared memory, where a stopped process holds up the others.

In shared memory, publishing takes a lock that the receiver takes as well. A subscriber that is
stopped (SIGSTOP, a debugger, a frozen container) while it holds that lock makes each attempt to
publish wait for a second, and what the publisher is to receive waits, too. With UDP there is no
such lock: the kernel drops what a stopped process does not read.

UDP is not the default: predictions of 19 road users are 0.3 MB, more than the buffers that Linux
gives a subscriber, and then came 0.25 s late instead of 0.04 s (measured).
"""

from __future__ import annotations

import os
from collections.abc import MutableMapping

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.resources import find_resource

CHOICE = "MTPGO_TRANSPORT"
"""The variable by which a user chooses ``udp``."""

_TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"

_PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""The files of profiles that Fast DDS reads: version 2 (ROS 2 Jazzy) the first, version 3 the
second. Both are set, since without a profile the whole subnet would be discovered."""

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"

_UDP = "UDPv4?sockets_size=4MB"
"""UDP with socket buffers for two messages of 20,000 objects (2 MB each); chosen. Linux grants at
most ``net.core.rmem_max``. With its default of 0.2 MB, messages above 0.2 MB arrive reliably only.
"""


def avoid_shared_memory(
    middleware: str, environment: MutableMapping[str, str] = os.environ
) -> bool:
    """Choose UDP as the only transport where the user wants it (:data:`CHOICE`).

    Transports or a profile that the user has given to Fast DDS stay.

    For the discovery range LOCALHOST, ROS adds shared memory whatever the variables of Fast DDS
    say. A profile takes its place that is for this machine only as well.

    Args:
        middleware: name of the ROS middleware; only Fast DDS is configured.
        environment: variables of the process, changed in place; before the first node.

    Returns:
        Whether UDP was chosen.

    Raises:
        ConfigurationError: the choice is unknown, or the profile is not among the installed files.
    """
    choice = environment.get(CHOICE, "")
    if choice not in ("", "udp"):
        raise ConfigurationError(f"{CHOICE} is {choice!r}, expected udp, or not to be set")
    if not choice:
        return False
    if not middleware.startswith("rmw_fastrtps"):
        return False
    if any(environment.get(name) for name in (_TRANSPORTS, *_PROFILES)):
        return False
    # Deprecated, and stronger than the range.
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        return False
    if environment.get(_RANGE) == "LOCALHOST":
        if environment.get("ROS_STATIC_PEERS"):
            return False  # The profile would lose them.
        profile = str(find_resource("config", "fastdds", "this_machine.xml"))
        environment[_RANGE] = "SYSTEM_DEFAULT"
        for name in _PROFILES:
            environment[name] = profile
    environment[_TRANSPORTS] = _UDP
    return True
