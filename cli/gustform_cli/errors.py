"""Errors of the scenario layer: several at once, with suggestions for misspelt names.

Codes of this layer; the ranges are those of `gustform.language.errors`, and what the language refuses (GF2001 not a
number, GF2002 not finite, GF2003 out of range, GF2004 not given, GF2006 name used twice, GF2007 no such component)
keeps its code here.

GF2101 file cannot be read      GF2201 unknown key           GF2012 unknown component type
GF2102 not valid YAML           GF2202 key missing           GF2402 unknown parameter of a component
GF2103 duplicate key            GF2203 wrong type            GF2403 terminals cannot be told
GF2104 not plain data           GF2204 value not allowed     GF2404 wind does not fit the component
GF2105 --set does not fit       GF2205 not a valid name      GF2405 event target does not exist
GF2301 unit missing             GF2501 wind file missing     GF2406 no channel matches
GF2302 another dimension        GF2502 wind file empty       GF2505 wind file: not a number
GF2303 unit not understood      GF2503 no such column        GF2506 wind file does not cover the run
GF2504 stamps not increasing    GF2507 speed that no wind has   GF2508 not the format, or cut short
GF2509 shape does not fit       GF2510 gap in the wind file     GF2511 times, zone and start do not fit
GF2512 package not installed    GF2513 samples too far apart
GF2601 axis of the wrong shape  GF2602 path set twice        GF2603 range that is none
GF2604 wind of a campaign       GF2606 no scalar matches     GF2607 dask is not installed
GF2608 no scheduler or workers  GF2609 worker of another version
GF6901 worker process died      GF6902 defect in a case
GF7001 result folder not writable   GF7002 result cannot be read   GF7003 file exists already
GF7004 folder in use by another sweep
GF7006 no checkpoint here          GF7007 checkpoint of another model or version
GF7008 run cannot go on: checkpoint damaged, or still running
"""

from __future__ import annotations

from gustform.language.errors import ErrorList, did_you_mean

__all__ = ["ErrorList", "did_you_mean"]
