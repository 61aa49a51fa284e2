# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where many items are worked on."""

from __future__ import annotations

from dataclasses import dataclass

from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import check_options, option


@dataclass(frozen=True)
class PoolOptions:
    """Where many items are worked on.

    Attributes:
        jobs: processes on this machine; 1 works in this process, without the extra ``fleet``.
        cluster: address of a running Dask scheduler, whose workers are used instead.

    Raises:
        ConfigurationError: a value is not allowed.
    """

    jobs: int = option(1, low=1)
    cluster: str = ""

    def __post_init__(self) -> None:
        check_options(self)
        if self.cluster and self.jobs > 1:
            raise ConfigurationError(
                f"jobs is {self.jobs} and a cluster is given, expected one: a cluster has its own "
                "number of processes"
            )

    @property
    def here(self) -> bool:
        """Whether all is done in this process."""
        return self.jobs == 1 and not self.cluster


HERE = PoolOptions()
"""All is done in this process."""
