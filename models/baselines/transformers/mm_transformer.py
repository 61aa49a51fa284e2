# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""mmTransformer: K fixed proposals that two stacked transformers turn into trajectories.

Y. Liu et al., "Multimodal Motion Prediction with Stacked Transformers", CVPR 2021: the motion
extractor and the social constructor of Sec. 3.2. The map aggregator between them is left out,
because no network here sees a map.
"""

import torch
from torch import Tensor, nn

from models.ablations.direct_covariance import DirectCovariance
from models.baselines.agent_headings import headings_at_t
from models.baselines.neighbour_relations import RELATIONS, neighbour_relations
from models.baselines.transformers.endpoint_regions import balanced_centres
from models.baselines.transformers.masked_attention import Transformer
from models.baselines.transformers.transformer_config import TransformerConfig
from models.gnn_layers.interaction_graph import complete_graph
from models.heads import FIRST_MODE, NoiseHead, first_circle
from models.own_frame.agent_frames import Start, states_to_own, states_to_scene
from models.own_frame.covariance_frames import rotate_blocks
from models.own_frame.small_linear import small_linear
from models.trajectory_predictor import TrajectoryPredictor


class MMTransformer(TrajectoryPredictor):
    """K proposals with confidence scores, S = 2.

    The mixture's weights are the confidence scores, its means the proposals. Its covariances are
    not in the publication: a head on the finished proposals gives them, and no gradient of it
    reaches anything else.

    Args:
        config: the network's options.

    Attributes:
        centre: [R, 2] centres of the regions of endpoints, in the agent's frame (m).
    """

    centre: Tensor

    def __init__(self, config: TransformerConfig):
        super().__init__(config)
        size, modes, heads = config.hidden, config.modes, config.attention_heads
        self.static_features = config.static_features
        self.yaw_as_angle = config.has_angle
        self.regions = config.used_regions
        inputs = self.condition.input_size + config.static_size * config.static_features
        self.embed_inputs = nn.Linear(inputs, size)
        self.embed_time = nn.Parameter(0.1 * torch.randn(config.history_steps, size))
        self.proposals = nn.Parameter(torch.randn(modes, size))
        self.motion_extractor = Transformer(size, heads, config.transformer_layers)
        self.summary = nn.Linear(modes * size, size)
        self.embed_relation = nn.Linear(RELATIONS, size)
        self.social_constructor = Transformer(size, heads, config.transformer_layers)
        self.generator = nn.Linear(size, size)
        self.path = small_linear(size, 2 * config.horizon_steps)
        self.selector = nn.Linear(size, size)
        self.score = small_linear(size, 1)
        self.first_path = nn.Parameter(first_circle(modes))
        favoured = torch.zeros(modes)
        favoured[0] = FIRST_MODE
        self.first_score = nn.Parameter(favoured)
        self.noise = NoiseHead(size, config.horizon_steps)
        self.covariance = DirectCovariance(config)
        time = config.dt_s * torch.arange(1, config.horizon_steps + 1)
        self.register_buffer("time_s", time, persistent=False)
        self.register_buffer("centre", torch.zeros(self.regions, 2))

    time_s: Tensor

    def roll_out(
        self,
        features: Tensor,
        valid: Tensor,
        static: Tensor,
        initial_covariance: Tensor | None,
        with_covariance: bool,
        teacher: Tensor | None,
        teacher_valid: Tensor | None,
        trails: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """See :meth:`TrajectoryPredictor.roll_out`; P_0, teacher and trails are ignored."""
        features, inputs, start = self.condition.encoder_inputs(
            features, valid, static, self.static_features
        )
        history = (self.embed_inputs(inputs) + self.embed_time).flatten(0, 1)  # [B N, T, D]
        queries = self.proposals.expand(history.size(0), -1, -1)
        moved = self.motion_extractor(history, valid.flatten(0, 1), queries)  # [B N, K, D]
        course = headings_at_t(features, valid, self.yaw_as_angle)
        around = self.neighbourhood(moved, features[:, :, -1], course, start)  # [B N, N, D]
        link = complete_graph(valid[:, :, -1]).flatten(0, 1)
        proposal = self.social_constructor(around, link, moved)
        proposal = proposal.view(valid.size(0), valid.size(1), self.modes, -1)  # [B, N, K, D]

        score = self.score(nn.functional.elu(self.selector(proposal))).squeeze(-1)
        log_weight = torch.log_softmax(score + self.first_score, dim=-1)  # [B, N, K]
        path = self.path(nn.functional.elu(self.generator(proposal)))
        deviation = path.unflatten(-1, (-1, 2)) + self.first_path.unsqueeze(1)  # [B, N, K, H, 2]
        velocity = start.velocity[:, :, None, None] + deviation
        own = start.position[:, :, None, None] + self.time_s.unsqueeze(-1) * velocity
        mean = states_to_scene(own.permute(3, 0, 1, 2, 4), start).permute(1, 2, 3, 0, 4)
        mean = mean.contiguous()
        if not with_covariance:
            return log_weight, mean, torch.empty(0, dtype=mean.dtype, device=mean.device)
        noise = self.noise(proposal.detach()).permute(0, 1, 5, 2, 3, 4)  # [2, 2, H, B, N, K]
        blocks = self.covariance(noise)
        return log_weight, mean, self.observed(rotate_blocks(blocks, start.direction))

    def neighbourhood(
        self, moved: Tensor, present: Tensor, course: Tensor, start: Start
    ) -> Tensor:
        """Return [B N, N, D] the embedded proposals of all agents relative to each agent.

        Args:
            moved: [B N, K, D] proposals of the motion extractor.
            present: [B, N, F] features at t.
            course: [B, N, 2] cosine and sine of the agents' headings.
            start: the agents' frames.
        """
        summary = self.summary(moved.flatten(1)).view(present.size(0), 1, present.size(1), -1)
        relation = neighbour_relations(present, course, start.direction)
        return torch.relu(summary + self.embed_relation(relation)).flatten(0, 1)

    @torch.jit.unused
    def own_endpoints(self, features: Tensor, valid: Tensor, target: Tensor) -> Tensor:
        """Return [B, N, 2] the last true positions [B, N, H, S] in the agents' frames (m)."""
        features = torch.where(valid.unsqueeze(-1), features, torch.zeros_like(features))
        start = self.condition.start(features, valid)
        own = states_to_own(target[:, :, -1:, :2], start)[:, :, 0]
        return own - start.position

    @torch.jit.unused
    def in_region(self, features: Tensor, valid: Tensor, target: Tensor) -> Tensor:
        """Return [B, N, K] which proposals belong to the region of the true endpoint.

        Args:
            features: [B, N, T, F].
            valid: [B, N, T].
            target: [B, N, H, S] true states in the scene frame; the last one counts.
        """
        endpoint = self.own_endpoints(features, valid, target)
        offset = endpoint.unsqueeze(2) - self.centre
        nearest = torch.linalg.vector_norm(offset, dim=-1).argmin(dim=-1, keepdim=True)
        own = torch.arange(self.modes, device=endpoint.device) % self.regions
        return own == nearest

    @torch.no_grad()
    def fit_futures(self, features: Tensor, valid: Tensor, target: Tensor, mask: Tensor) -> None:
        """Set the regions' centres from sample scenes."""
        known = (mask[..., -1] > 0.0) & valid[..., -1]
        endpoint = self.own_endpoints(features, valid, torch.nan_to_num(target))[known]
        self.centre.copy_(balanced_centres(endpoint, self.regions))
