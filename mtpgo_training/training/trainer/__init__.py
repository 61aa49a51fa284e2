# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Training on Lightning: the module, its data, and what watches over a run.

Only ``mtpgo train`` imports this package, and only when it runs, for Lightning takes seconds to
load and comes with the extra ``training``.
"""
