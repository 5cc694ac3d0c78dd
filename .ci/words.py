"""The words that .ci/vocabulary refuses, what stands in their place, and where they are right."""

# An item's name is split into lower-case words: `CellMaker` and `cell_maker` are "cell maker". Each row: a regular
# expression on these words; the kinds of items that it holds for; folders that it holds for (empty: all); an expression
# on the words, or a folder that ends in "/", where the word is right; what to write.
# Kinds: type, variant, fn, field, const, mod, macro, file, key (a string that is a single name), local, test (a
# function of a test). Local variables of tests are not checked, and a test's name is an English sentence: `says`, `part`,
# `door` and `woken` are right there.
ITEMS = "type variant fn field const mod macro file key test"
NOT_TESTS = "type variant fn field const mod macro file key local"
EVERYWHERE = ITEMS + " local"
NAMES = "type fn field const mod file"
# Worlds have real doors, halls and lines of sight.
WORLD = "tools/simulator/"

ROWS = [
    # Places, observations, candidates.
    (r"\bplaces?\b", "type mod file", "", r"place recognition", "MapKeyframe, or what it holds"),
    (r"^places?$", "field", "", "", "map_keyframe, or what it holds"),
    # To place something is right elsewhere.
    (r"^places?$", "fn", "mapper odometry", "", "map_keyframe, or what it holds"),
    (r"\bsights?\b", ITEMS, "", r"(line|out) of sight|across sight", "observation"),
    # A topic's slots are iceoryx2's.
    (r"^slot$", "type mod file", "", "", "WindowScan, BeamSlot, HistoryEntry: what it holds"),
    (r"\btrails?\b", ITEMS, "", "", "QuerySubmap"),
    (r"^leads?$", NAMES, "mapper core/messages tools/randt", "", "LoopCandidate"),
    (r"^source$", "type mod file", "odometry mapper", "", "MessageId; CandidateOrigin"),
    (r"^candidate$", "type", "mapper", "", "LoopCandidate, LoopClosure"),
    (r"\bfates?\b", EVERYWHERE, "", "", "LoopStatus, status"),
    # Odometry.
    (r"\bfound(ing|ed|er)\b|\bfound later\b", EVERYWHERE, "", "", "initialization, Initializer"),
    # Sensors and filters settle.
    (r"\bsettle[sd]?\b|\bsettling\b", ITEMS, "odometry mapper core/messages core/stage", "", "retire_oldest; optimize_and_prune; solve_truncated; final"),
    (r"\bslides?\b|\bslid\b", NAMES, "odometry mapper", "", "marginalize_oldest"),
    (r"^chain$", "type mod file", "odometry mapper", "", "BlockTridiagonalSystem; OdometryChain"),
    (r"\blevers?\b", ITEMS, "", r"lever arms?", "velocity_jacobian_s; lever_arm"),
    (r"^(heading|moment)s?$", "type mod file", "odometry", "", "GyroIntegrator, GyroState"),
    (r"\bcell maker\b", EVERYWHERE, "", "", "NdtBuilder"),
    (r"\bjudges?\b", "type mod file", "", "", "TrackingMonitor"),
    # The mapper.
    (r"\bjoin(s|ed|ing)?\b", NAMES, "mapper", "", "merge, align_component"),
    (r"\bparts?\b", NAMES, "mapper", r"(from|into) parts", "component"),
    (r"\bties?\b", NAMES, "mapper odometry", "", "intra_submap_constraint"),
    (r"\bgroups?\b", NAMES, "mapper", "", "clusters"),
    (r"\bhearings?\b|\bappeal(s|ed)?\b|\bwitness(es)?\b", EVERYWHERE, "", "", "consistency, reinstate, support"),
    (r"\bverdicts?\b", ITEMS, "mapper", "", "ConsensusResult"),
    (r"^standing$", NAMES, "mapper", "", "membership"),
    (r"\bintakes?\b", EVERYWHERE, "", "", "keyframe_ingest"),
    (r"\boutlets?\b", EVERYWHERE, "", "", "map_publisher"),
    (r"^behind$", "type mod file", "", "", "replay_queue"),
    # The process shell.
    (r"^past$", "type mod file", "", "", "CheckpointStore"),
    (r"\brealms?\b", EVERYWHERE, "", "", "domain"),
    (r"\bdoors?\b", NOT_TESTS, "", WORLD, "locks"),
    (r"\bjanitors?\b", EVERYWHERE, "", "", "dead_node_cleanup"),
    (r"\bsweeps?\b", ITEMS, "core/stage", "", "clean up: a sweep is the radar's turn"),
    (r"^(waits|wakes)$", "type", "", "", "PortWaiter, Waitable"),
    (r"\bwoken\b", NOT_TESTS, "", "", "WakeReason"),
    (r"\bwell ?known\b", EVERYWHERE, "", "", "foxglove_schemas"),
    (r"\bharvest(s|ed|ing)?\b", EVERYWHERE, "", "", "finish_drive"),
    (r"\bconclusions?\b|^conclude$", ITEMS, "", "", "finish_drive"),
    (r"^saved$", "macro", "", "", "persist!"),
    (r"^(un)?seal(ed)?$|^seal ", "fn type field mod file", "", "", "encode, decode"),
    (r"^label$", "type", "core odometry mapper", "", "StateIdentity"),
    # Verbs.
    (r"\btold\b|\btell(s|ing)?\b", EVERYWHERE, "", "", "log_*, publish_*, set_status; in a test: reports, names"),
    (r"\bsay(s|ing)?\b|\bsaid\b", "type variant fn field const mod macro file", "", "", "log_*, publish_*, output"),
    (r"^note$|^note ", "fn", "", "", "log_*, set_status, record"),
    (r"^looks?$|^look (?!up)", "fn", "", "", "poll, inspect"),
    (r"\blooks?\b(?! up)", "mod type", "", "", "poll, inspect"),
    (r"\bmend(s|ed|ing)?\b", EVERYWHERE, "", "", "fix, repair"),
    # A robot that drives to one side is no file.
    (r"\baside\b", EVERYWHERE, "", "tools/calibration/", "quarantine"),
    # Tests.
    (r"\bblows?\b|\bspoil(s|t|ed)?\b", EVERYWHERE, "", "", "fault_injection, corrupt_inputs"),
    (r"^halls?$", "type fn mod file", "", WORLD, "l_shaped_world"),
    # A function says what it returns or takes.
    (r"^of$", "fn test", "", "", "from_scan, covariance_of"),
]

# Comments, texts and documents: an expression, an exception on the line, and what to write.
PROSE = [
    (r"\bso many\b", "", "that many"),
    (r"\bso long\b|\bso often\b", "", "as long as, that long, that often"),
    (r"\b(?:by|with) so much\b|\bso much of\b", "", "by that much, that share"),
    (r"\bbe it\b(?! possible)", r"\b(would|could|can|may|must|might|will|not) be it\b", "whether"),
    (r"\bwhoever\b|\bwhosoever\b", "", "the one that, whichever"),
    (r"\btold\b", "", "reported, given"),
    (r"\bwhatever (?:\w+ )?it be\b", "", "whatever it is"),
    (r"\bof it[.;]", r"\b(some|most|all|none|any|half|rest|part|much|more|nothing|out|because) of it\b", "name the thing"),
    (r"(?:^|[.:] )Nothing but\b|(?:^|[.:] )Not thought of\b", "", "an ordinary sentence"),
    (r"\b(?:un)?mend(?:s|ed|ing)?\b", "", "fix, repair"),
    (r"\b(?:set|sets|setting) (?:\w+ )?aside\b", "", "quarantine"),
    (r"\brealms?\b|\bjanitors?\b|\bharvest(?:s|ed|ing)?\b|\bspoilt\b|\bwellknown\b", "", "the vocabulary's word"),
    # A report of an earlier build, in quotes, has the former key.
    (r"\bfounding\b|\bfates?\b", r"\"fates?\"|loops\.fates", "initialization; status"),
    # What a careless renaming leaves: a type's name where a verb stands.
    (r"^[/! ]*(?:.*\. )?(?:PortWaiter|Waitable) (?:for|until|while|when|as|at|in)\b", "", "waits, wakes"),
    (r"(?-i:\bDESIGN\b)", "", "a decision or invariant that ships: ARCHITECTURE.md, docs/decisions"),
]
