"""Many runs of many scenarios, seeded and resumable.

sweep file → cells (`grid`, `cells`; random ones by `scenes`, `draw`) → tasks → `pool` of `worker` processes
→ `journal` → `report` with `statistics` → table, JSON, picture. Whatever can be known beforehand is refused
before anything is flown; whatever was flown is in the journal before it counts.
"""
