-- The tables of run.sqlite. docs/store.md explains their columns.
CREATE TABLE run (schema_version INTEGER NOT NULL, config TEXT NOT NULL, result TEXT, checksum TEXT);
CREATE TABLE sessions (
    number INTEGER PRIMARY KEY, began TEXT NOT NULL, seconds REAL NOT NULL, overrides TEXT NOT NULL,
    versions TEXT NOT NULL, checksum TEXT
);
CREATE TABLE requests (
    id TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, gripper INTEGER NOT NULL,
    temperature REAL NOT NULL, elites TEXT NOT NULL, digest TEXT NOT NULL, checksum TEXT
);
CREATE TABLE replies (
    request_id TEXT PRIMARY KEY REFERENCES requests(id), model TEXT NOT NULL, text TEXT NOT NULL, error TEXT,
    prompt_tokens INTEGER, completion_tokens INTEGER, cost_usd REAL, unanswered INTEGER, checksum TEXT
);
CREATE TABLE strategies (
    generation INTEGER NOT NULL, agent INTEGER NOT NULL, strategy INTEGER NOT NULL, parents TEXT NOT NULL,
    design TEXT NOT NULL, checksum TEXT, PRIMARY KEY (generation, agent, strategy)
);
CREATE TABLE evaluations (
    candidate TEXT PRIMARY KEY, generation INTEGER NOT NULL, agent INTEGER NOT NULL, strategy INTEGER NOT NULL,
    plan INTEGER NOT NULL, waypoints TEXT NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL,
    reward REAL NOT NULL, distance_m REAL, ik_error_m REAL, ik_error_rad REAL, tracking_error_rad REAL,
    moved_m TEXT NOT NULL, warnings TEXT NOT NULL, content TEXT NOT NULL, details TEXT NOT NULL, checksum TEXT
);
CREATE TABLE generations (number INTEGER PRIMARY KEY, summary TEXT NOT NULL, checksum TEXT);
