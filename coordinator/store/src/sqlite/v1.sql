-- The store of a Flyby coordinator, schema 1: what of all durable events still matters.
-- A coordinator that runs holds this file alone; look at a copy, or when it has stopped.
-- Times of the calendar are milliseconds since 1970 (unix_ms), lengths of time microseconds (us).
-- Digests are BLAKE3: hexadecimal where they are text, 32 bytes where they are blobs.

CREATE TABLE farm (
    one INTEGER PRIMARY KEY CHECK (one = 1), -- there is one row
    last_job INTEGER NOT NULL                -- the largest number a job was ever given
) STRICT;
INSERT INTO farm VALUES (1, 0);

CREATE TABLE jobs (
    job INTEGER PRIMARY KEY,
    unix_ms INTEGER NOT NULL,      -- when it was submitted
    submission TEXT NOT NULL,      -- the client's number for it, 128 bits
    name TEXT NOT NULL,
    scene TEXT NOT NULL,           -- digest of the scene description
    revision INTEGER NOT NULL,     -- of the renderer
    frames_start INTEGER NOT NULL, -- frames start, start + step, ... below end
    frames_end INTEGER NOT NULL,
    frames_step INTEGER NOT NULL,
    x0 INTEGER NOT NULL,           -- what is rendered of each image: x0 <= x < x1, y0 <= y < y1
    y0 INTEGER NOT NULL,
    x1 INTEGER NOT NULL,
    y1 INTEGER NOT NULL,
    tiles TEXT NOT NULL CHECK (tiles IN ('rule', 'size', 'time')),
    tiles_a INTEGER,               -- rule: fewest pixels; size: columns; time: us; NULL is the farm's own
    tiles_b INTEGER,               -- size: rows
    priority INTEGER NOT NULL,     -- as it was submitted
    share INTEGER NOT NULL,
    priority_now INTEGER NOT NULL,
    share_now INTEGER NOT NULL,
    threads INTEGER NOT NULL,      -- what it asks of workers
    memory_bytes INTEGER NOT NULL,
    about TEXT NOT NULL,           -- the coordinator's, JSON
    paused INTEGER NOT NULL DEFAULT 0 CHECK (paused IN (0, 1)),
    focus_x0 INTEGER,              -- the region of interest, or NULL four times
    focus_y0 INTEGER,
    focus_x1 INTEGER,
    focus_y1 INTEGER,
    cancelled_unix_ms INTEGER,     -- NULL where it was not cancelled
    log_lines INTEGER NOT NULL DEFAULT 0 -- lines its log ever had; the last 1,000 are kept
) STRICT;

-- What a job asks of workers.
CREATE TABLE labels (
    job INTEGER NOT NULL,
    label TEXT NOT NULL,
    PRIMARY KEY (job, label)
) STRICT, WITHOUT ROWID;

-- Jobs that a job waits for, in the order in which it named them.
CREATE TABLE waits (
    job INTEGER NOT NULL,
    place INTEGER NOT NULL,
    waits_for INTEGER NOT NULL,
    PRIMARY KEY (job, place)
) STRICT, WITHOUT ROWID;

-- Images that are over: encoded, or failed for a reason. Of these there are no blocks.
CREATE TABLE images (
    job INTEGER NOT NULL,
    image INTEGER NOT NULL,
    state TEXT NOT NULL CHECK (state IN ('encoded', 'failed')),
    unix_ms INTEGER NOT NULL,
    film TEXT,                     -- digest of all its values
    blocks INTEGER,
    render_us INTEGER,
    about TEXT,                    -- the coordinator's, JSON
    reason TEXT,
    PRIMARY KEY (job, image)
) STRICT, WITHOUT ROWID;

-- Blocks that are synced in the scratch file of an image that is not over.
CREATE TABLE blocks (
    job INTEGER NOT NULL,
    image INTEGER NOT NULL,
    y0 INTEGER NOT NULL,
    x0 INTEGER NOT NULL,
    y1 INTEGER NOT NULL,
    x1 INTEGER NOT NULL,
    elapsed_us INTEGER NOT NULL,   -- what one thread took
    pixels BLOB NOT NULL CHECK (length(pixels) = 32), -- digest of its pixels
    about BLOB NOT NULL,           -- the coordinator's counters
    PRIMARY KEY (job, image, y0, x0, y1, x1)
) STRICT, WITHOUT ROWID;

-- The last lines of each job's log, numbered from 1.
CREATE TABLE log (
    job INTEGER NOT NULL,
    line INTEGER NOT NULL,
    unix_ms INTEGER NOT NULL,
    text TEXT NOT NULL,
    PRIMARY KEY (job, line)
) STRICT, WITHOUT ROWID;
