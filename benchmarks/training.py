# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Run `mtpgo benchmark training` as a script, with the same options."""

import sys

from mtpgo_training.cli import main

if __name__ == "__main__":  # the processes that measure memory import this file again
    sys.exit(main(["benchmark", "training", *sys.argv[1:]]))
