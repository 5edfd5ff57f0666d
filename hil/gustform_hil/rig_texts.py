"""CMakeLists.txt and README.md of a rig."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Any

# Sources of the program itself; what is not there is left out.
PROGRAM = ("bridge/src/main.c", "bridge/src/plant_model.c", "bridge/src/plant_program.c")


def cmake(prefix: str, files: Sequence[str]) -> str:
    """The one CMake file of a rig: controller in C99, everything else in C11. `prefix` is a name in C."""
    sources = [f for f in files if f.endswith(".c") and not f.startswith("bridge/tools/")]
    listed = "\n".join(f"    {name}" for name in sources if name not in PROGRAM)
    program = " ".join(name for name in PROGRAM if name in sources)
    tools = "\n".join(_tool(name) for name in files if name.startswith("bridge/tools/"))
    return f"""# cmake -S . -B build && cmake --build build
cmake_minimum_required(VERSION 3.18)
project(gust_rig C)

set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
if(NOT CMAKE_BUILD_TYPE)
    set(CMAKE_BUILD_TYPE Release)
endif()
find_package(Threads REQUIRED)
# No fused multiply-add: the same bits on every machine.
add_compile_options(-ffp-contract=off)

add_library(controller STATIC controller/{prefix}.c controller/{prefix}_interface.c)
set_target_properties(controller PROPERTIES C_STANDARD 99)
target_include_directories(controller PUBLIC controller)
target_link_libraries(controller PUBLIC m)

add_library(bridge STATIC
{listed}
)
set_target_properties(bridge PROPERTIES C_STANDARD 11)
target_include_directories(bridge PUBLIC bridge/include messages)
target_compile_definitions(bridge PUBLIC _GNU_SOURCE)
target_link_libraries(bridge PUBLIC controller Threads::Threads)

add_executable(gust-bridge {program})
set_target_properties(gust-bridge PROPERTIES C_STANDARD 11)
target_compile_definitions(gust-bridge PRIVATE GUST_BRIDGE_PREFIX={prefix})
target_link_libraries(gust-bridge PRIVATE bridge)

# --role plant: a simulation in the place of the converter.
option(GUST_BRIDGE_PLANT "gust-bridge --role plant as well; needs libgustform" OFF)
set(GUST_BRIDGE_RUNTIME "" CACHE PATH "Folder gustform_runtime with include and lib of libgustform")
if(GUST_BRIDGE_PLANT)
    find_path(GUSTFORM_INCLUDE gustform/gust_sim.h HINTS "${{GUST_BRIDGE_RUNTIME}}/include" REQUIRED)
    find_library(GUSTFORM_LIBRARY gustform HINTS "${{GUST_BRIDGE_RUNTIME}}/lib" REQUIRED)
    target_compile_definitions(gust-bridge PRIVATE GUST_BRIDGE_PLANT)
    target_include_directories(gust-bridge SYSTEM PRIVATE "${{GUSTFORM_INCLUDE}}")
    target_link_libraries(gust-bridge PRIVATE "${{GUSTFORM_LIBRARY}}")
endif()

{tools}"""


def _tool(file: str) -> str:
    name = f"gust-{PurePosixPath(file).stem}"
    return f"""add_executable({name} {file})
set_target_properties({name} PROPERTIES C_STANDARD 11)
target_link_libraries({name} PRIVATE bridge)
"""


def readme(description: dict[str, Any]) -> str:
    """What this rig is, and how it is compiled and run."""
    d = description
    return f"""# A rig: {d["control"]} on a CAN bus

`gust-bridge` runs the control {d["control"]} of the turbine `{d["turbine"]}` in the scenario
`{d["scenario"]}` every {d["period_s"] * 1e3:g} ms, behind the message set {d["messages"]} with the fingerprint
{d["fingerprint"]}. `rig.json` says all of it, with the SHA-256 of each file; the controller has a README of
its own.

```sh
cmake -S . -B build
cmake --build build
./build/gust-bridge --interface can0
```

It needs CMake 3.18, a C compiler and Linux with SocketCAN: no Python, no gustform. The folder `build` stays behind
when the others are copied to another computer. The interface has to be up, and a bus that went off is not to come
back by itself:

```sh
sudo ip link set can0 type can bitrate 500000 dbitrate 2000000 fd on restart-ms 0
sudo ip link set can0 up
```

A classic bus has `bitrate 1000000` and neither `dbitrate` nor `fd`. `gustform hil budget` tells whether the messages
fit. `--clock monotonic`, the default, keeps time itself; with `--clock sync` each Sync frame is one period.

The bridge waits in INIT for the converter and in READY for the operator's start; any fault leads to SAFE, which only
the operator's reset leaves. What SAFE guarantees and what it does not stands in `hil/README.md` of gustform.
`build/gust-soak` sends many frames through a bus and counts what became of them, `build/gust-latency` measures how soon
a bridge answers and is safe.
"""
