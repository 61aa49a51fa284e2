# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of mmTransformer, in addition to those that all networks have."""

from dataclasses import dataclass

from models.baselines.baseline_config import BaselineConfig
from mtpgo_core.errors import ConfigurationError
from mtpgo_core.options import option


@dataclass(frozen=True)
class TransformerConfig(BaselineConfig):
    """Options of mmTransformer; its K proposals are the ``modes``, its channels ``hidden``.

    Attributes:
        attention_heads: heads of every attention; they divide ``hidden``.
        transformer_layers: encoder and decoder layers of each of the two transformers.
        regions: into which the endpoints are divided for training, at most one for each proposal.
            The proposals are dealt to them in turn.
    """

    attention_heads: int = option(4, low=1)
    transformer_layers: int = option(1, low=1)
    regions: int = option(4, low=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hidden % self.attention_heads:
            raise ConfigurationError(
                f"model.attention_heads is {self.attention_heads}, expected a divisor of "
                f"model.hidden, {self.hidden}"
            )

    @property
    def used_regions(self) -> int:
        """R, ``regions`` or one for each proposal if there are fewer."""
        return min(self.regions, self.modes)
