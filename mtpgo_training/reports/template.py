# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page's frame. One file, nothing from outside, readable on paper, too."""

PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>
:root { --ink: #22272c; --soft: #5d6872; --line: #e1e4e7; --ground: #f6f6f4; --accent: #2a6fbb; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Helvetica, Arial, sans-serif; }
main { max-width: 1240px; margin: 0 auto; padding: 32px 20px 64px; }
h1 { font-size: 26px; margin: 0 0 4px; }
h2 { font-size: 18px; margin: 40px 0 10px; }
h3 { font-size: 15px; margin: 20px 0 6px; }
p { margin: 6px 0 10px; max-width: 78ch; }
.soft, figcaption, .note { color: var(--soft); }
.card { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 14px 16px;
  margin: 12px 0; overflow-x: auto; }
.warning { border-left: 4px solid #c0392b; }
.warning p { margin: 2px 0; }
table { border-collapse: collapse; width: 100%; font-size: 12.5px;
  font-variant-numeric: tabular-nums; }
th, td { padding: 5px 6px; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
th { color: var(--soft); font-weight: 600; border-bottom: 1px solid var(--line); }
tbody tr + tr td { border-top: 1px solid #f0f1f2; }
tr.baseline td { color: var(--soft); }
td.best { font-weight: 700; color: var(--ink); }
.span { display: block; font-size: 10.5px; color: var(--soft); font-weight: 400; }
.dot { display: inline-block; width: 9px; height: 9px; border-radius: 50%; margin-right: 7px; }
.figures { display: grid; grid-template-columns: repeat(3, 1fr); gap: 12px; }
@media (max-width: 900px) { .figures { grid-template-columns: 1fr; } }
figure { margin: 0; }
.figures figure, .wide { background: #fff; border: 1px solid var(--line); border-radius: 8px;
  padding: 10px; }
.wide { margin: 12px 0; }
img { width: 100%; height: auto; display: block; }
figcaption { font-size: 13px; padding: 6px 4px 0; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 4px 18px; margin: 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
@media print { body { background: #fff; } .card, figure { break-inside: avoid; } }
</style>
</head>
<body><main>
<h1>{{ title }}</h1>
<p class="soft">{{ subtitle }}</p>
{% if warnings %}<div class="card warning">{% for w in warnings %}
<p><strong>Not a clean test:</strong> {{ w }}.</p>{% endfor %}</div>{% endif %}
{% for note in notes %}<p class="note">Note: {{ note }}.</p>{% endfor %}

{% macro table(t) %}<div class="card"><table>
<thead><tr>{% for head in t.heads %}<th>{{ head }}</th>{% endfor %}</tr></thead>
<tbody>{% for row in t.rows %}<tr{% if row.baseline %} class="baseline"{% endif %}>
<td>{% if row.colour %}<span class="dot" style="background:{{ row.colour }}"></span>{% endif %}\
{{ row.name }}</td>
{% for cell in row.cells %}<td{% if cell.best %} class="best"{% endif %}>{{ cell.text }}\
{% if cell.span %}<span class="span">{{ cell.span }}</span>{% endif %}</td>{% endfor %}
</tr>{% endfor %}</tbody></table></div>{% endmacro %}

{% for section in tables %}<h2>{{ section.heading }}</h2>
<p class="soft">{{ section.text }}</p>
{{ table(section) }}{% endfor %}

{% if agreement %}<h2>Recorded and offline predictions</h2>
<p class="soft">The means of all modes and steps of the recorded predictions against those that the
model file makes offline from the same observations at the same instants.</p>
{{ table(agreement) }}{% endif %}

<h2>Over the horizon and calibration</h2>
<div class="figures">{% for f in figures %}<figure><img alt="{{ f.alt }}" src="{{ f.data }}">
<figcaption>{{ f.caption }}</figcaption></figure>{% endfor %}</div>

{% if groups or wide %}<h2>By manoeuvre, class and recording</h2>{% endif %}
{% for f in wide %}<figure class="wide"><img alt="{{ f.alt }}" src="{{ f.data }}">
<figcaption>{{ f.caption }}</figcaption></figure>{% endfor %}
{% for section in groups %}<h3>{{ section.heading }}</h3>
<p class="soft">{{ section.text }}</p>{{ table(section) }}{% endfor %}

{% if scenes %}<h2>Scenes</h2>
<p class="soft">Each panel is turned so that the road user in focus drives to the right. Best is
where the model gained the most over constant velocity, worst where its ADE is the largest; each
road user once, and different sites as far as there are any.</p>{% endif %}
{% for f in scenes %}<h3>{{ f.heading }}</h3><figure class="wide">
<img alt="{{ f.alt }}" src="{{ f.data }}"></figure>{% endfor %}

<h2>What was evaluated</h2>
<div class="card"><dl>{% for key, value in facts %}<dt>{{ key }}</dt><dd>{{ value }}</dd>\
{% endfor %}</dl></div>
<h2>How to read it</h2>
<div class="card"><dl>{% for key, value in glossary %}<dt>{{ key }}</dt><dd>{{ value }}</dd>\
{% endfor %}</dl></div>
</main></body></html>
"""

CAPTIONS = {
    "horizon": "Distance of the heaviest mode from the truth at each time ahead; the band is the "
    "95 % interval over recordings. All curves share the recordings, so their order is surer than "
    "the band looks: see the column ADE / cv.",
    "reliability": "How often the truth lies in the heaviest mode's ellipse of each level. Above "
    "the line the ellipses are too large, below too small.",
    "nees": "Squared error of the heaviest mode weighed by its covariance (solid) and of the "
    "whole mixture (dotted). Above 2 the covariance is too small, below too large.",
    "manoeuvres": "Judged by what the road user did, never by the prediction; in brackets how "
    "many.",
}
"""Under each figure, by its name."""

GLOSSARY = (
    ("ADE, FDE", "distance of the heaviest mode from the truth, over the horizon and at its end"),
    ("MR", "share of road users whose heaviest mode ends more than 2 m off"),
    ("APDE", "distance of the predicted positions from the nearest observed one: the error of the "
     "path, whatever the speed"),
    ("ANLL, FNLL", "negative log-likelihood of the true position under the whole mixture (nats), "
     "over the horizon and at its end; lower is better"),
    ("minADE, minFDE", "of the best of all modes"),
    ("in 50/90/95%", "share of truths inside the heaviest mode's ellipse of that probability"),
    ("agents", "predicted road users, each once an instant; FDE, MR and FNLL are over those that "
     "were observed to the end of the horizon"),
    ("small figures", "95 % interval over recordings (bootstrap): what other recordings of the "
     "same kind would give"),
    ("cv, ca, ctrv", "constant velocity, constant acceleration, constant turn rate and velocity, "
     "from the same history"),
)  # fmt: skip
"""What the words on the page mean."""
