# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0

from mtpgo_training.table_format import Cell, Row, Table, to_html, to_markdown, to_text

TABLE = Table(
    ["", "ADE m", "agents"],
    [
        Row("a <b>", [Cell("0.50", "0.40 to 0.60", best=True), "12"], colour="#123456"),
        Row("cv", [Cell("1.25"), "12"], baseline=True),
    ],
)


def test_columns_of_the_terminal_are_aligned():
    assert to_text(TABLE).splitlines() == [
        "                     ADE m  agents",
        "a <b>  0.50 (0.40 to 0.60)      12",
        "cv                    1.25      12",
    ]


def test_markdown_has_a_rule_below_the_heads():
    assert to_markdown(TABLE).splitlines() == [
        "|  | ADE m | agents |",
        "| --- | --- | --- |",
        "| a <b> | 0.50 (0.40 to 0.60) | 12 |",
        "| cv | 1.25 | 12 |",
    ]


def test_html_is_escaped_and_marked():
    text = to_html(TABLE)
    assert '<span class="dot" style="background:#123456"></span>a &lt;b&gt;</td>' in text
    assert '<td class="best">0.50<span class="span">0.40 to 0.60</span></td><td>12</td>' in text
    assert '<tr class="baseline">' in text
    assert text.startswith("<table>\n<thead><tr><th></th><th>ADE m</th><th>agents</th></tr>")


def test_a_table_without_rows_has_its_heads():
    assert to_text(Table(["", "ADE m"], [])) == "  ADE m"
