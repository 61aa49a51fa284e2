# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""GNN layers on small complete graphs, dense and masked (paper, section "GNN Layers").

On the same weights they agree with torch_geometric's layers of the same definition.
"""
