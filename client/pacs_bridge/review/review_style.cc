// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/review/review_page.h"

namespace tissueform {

// The planner's colours and type (client/web/src/styles).
absl::string_view ReviewStyle() {
  return R"css(
:root { color-scheme: light dark; --ground: #e9ebee; --panel: #fbfbfc; --raised: #ffffff; --line: #d8dce1;
  --text: #1d2126; --quiet: #59616b; --accent: #0b6f8a; --on-accent: #ffffff; --problem: #a8201a;
  --radius: 8px; font: 14px/1.45 system-ui, -apple-system, "Segoe UI", "Noto Sans", sans-serif; }
@media (prefers-color-scheme: dark) { :root { --ground: #16181b; --panel: #1f2226; --raised: #2a2e33;
  --line: #373c43; --text: #e8eaed; --quiet: #a3abb5; --accent: #6cc3dd; --on-accent: #0d2027;
  --problem: #ff9d94; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--text); }
header, main { max-width: 1200px; margin: 0 auto; padding: 24px; }
header { display: flex; gap: 24px; align-items: baseline; padding-bottom: 0; }
header p:last-child { margin-left: auto; }
h1 { font-size: 26px; font-weight: 600; letter-spacing: -0.02em; margin: 0; }
h2 { font-size: 16px; margin: 24px 0 12px; }
h3 { font-size: 14px; margin: 0 0 8px; }
p, dl, dd { margin: 0; }
small, .quiet { color: var(--quiet); font-size: 12px; }
.problem { color: var(--problem); }
.notice, article, .wide { background: var(--panel); border: 1px solid var(--line); border-radius: var(--radius); }
.notice { padding: 12px 16px; }
article { padding: 16px; margin-bottom: 12px; display: grid; gap: 12px; }
article.waits { border: 2px solid var(--accent); }
dl { display: flex; flex-wrap: wrap; gap: 8px 32px; }
dt { color: var(--quiet); font-size: 12px; }
dd { font-size: 16px; overflow-wrap: anywhere; }
.pictures { display: flex; flex-wrap: wrap; gap: 8px; }
.pictures img { width: 260px; max-width: 100%; border-radius: 4px; border: 1px solid var(--line); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: 10px 12px; vertical-align: top; border-bottom: 1px solid var(--line);
  overflow-wrap: anywhere; min-width: 90px; }
thead th { color: var(--quiet); font-size: 12px; font-weight: 600; }
tbody th { font-weight: 600; }
td:nth-child(2), td:nth-child(4) { white-space: nowrap; }
tbody tr:last-child > * { border-bottom: 0; }
a { color: var(--accent); }
button { font: inherit; font-weight: 600; padding: 10px 16px; border: 0; border-radius: var(--radius);
  background: var(--accent); color: var(--on-accent); cursor: pointer; }
a:focus-visible, button:focus-visible, .wide:focus-visible { outline: 3px solid var(--accent); outline-offset: 2px; }
)css";
}

}  // namespace tissueform
