-- The tables of run.sqlite. docs/store.md explains their columns.
CREATE TABLE IF NOT EXISTS run (schema_version INTEGER NOT NULL, config TEXT NOT NULL, result TEXT);
CREATE TABLE IF NOT EXISTS sessions (
    number INTEGER PRIMARY KEY, seconds REAL NOT NULL, versions TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS requests (
    id TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, gripper INTEGER NOT NULL,
    temperature REAL NOT NULL, elites TEXT NOT NULL, digest TEXT NOT NULL,
    purpose TEXT NOT NULL DEFAULT 'designs', recalled TEXT NOT NULL DEFAULT '[]'
);
CREATE TABLE IF NOT EXISTS replies (
    request_id TEXT PRIMARY KEY REFERENCES requests(id), model TEXT NOT NULL, text TEXT NOT NULL, error TEXT,
    prompt_tokens INTEGER, completion_tokens INTEGER, cost_usd REAL,
    unanswered INTEGER NOT NULL DEFAULT 0, cached_tokens INTEGER, saved_usd REAL, cut_by TEXT NOT NULL DEFAULT ''
);
CREATE TABLE IF NOT EXISTS designs (
    generation INTEGER NOT NULL, agent INTEGER NOT NULL, design INTEGER NOT NULL, parents TEXT NOT NULL,
    written TEXT NOT NULL, PRIMARY KEY (generation, agent, design)
);
CREATE TABLE IF NOT EXISTS evaluations (
    candidate TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, design INTEGER NOT NULL,
    plan INTEGER NOT NULL, waypoints TEXT NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL,
    reward REAL NOT NULL, distance_m REAL, content TEXT NOT NULL, details TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS trials (
    number INTEGER PRIMARY KEY, content TEXT NOT NULL, task TEXT NOT NULL, engine TEXT NOT NULL,
    layout INTEGER NOT NULL, change INTEGER, candidate TEXT NOT NULL, status TEXT NOT NULL, reward REAL NOT NULL,
    details TEXT NOT NULL
);
