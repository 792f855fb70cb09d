# SPDX-License-Identifier: Apache-2.0
"""Skeletons that call a library in a flight-software framework: an F Prime component and a cFS application.

They are short and meant to be edited: what is read and what becomes of the outputs is the mission's. They have been
compiled against declarations of the few functions that they use, not against the frameworks.
"""

from pathlib import Path

from css_common.whole_files import write_whole
from css_export.library import Library

_MADE = "Made by `sunpoint export` as a beginning, to be edited. Compiled against declarations alone, never run."


def write_glue(library: Library, folder: Path) -> None:
    """Writes the skeletons into `fprime` and `cfs` below a library's folder.

    Raises:
        OSError: they cannot be written.
    """
    name = component_name(library)
    texts = {
        Path("fprime", f"{name}.fpp"): fpp(library),
        Path("fprime", f"{name}.hpp"): fprime_header(library),
        Path("fprime", f"{name}.cpp"): fprime_source(library),
        Path("cfs", f"{library.prefix}_app.c"): cfs_app(library),
    }
    for place, text in texts.items():
        (folder / place).parent.mkdir(exist_ok=True)
        write_whole(folder / place, text)


def component_name(library: Library) -> str:
    """`SunFilter` of the library of `sun_filter`."""
    return "".join(part.capitalize() for part in library.prefix.removeprefix("sunpoint_").split("_"))


def fpp(library: Library) -> str:
    """The component in F Prime's modelling language."""
    name = component_name(library)
    return f"""# SPDX-License-Identifier: Apache-2.0
# {_MADE}
module Sunpoint {{

  @ {library.function.about}
  passive component {name} {{

    @ One step for each call of the rate group
    guarded input port schedIn: Svc.Sched

    @ Parameters out of their limits: which row of {library.prefix}_limits
    event ParametersRefused(row: I32) severity warning high format "parameters refused, limit {{}}"

    event port Log
    text event port LogText
    time get port Time

  }}

}}
"""


def fprime_header(library: Library) -> str:
    """The component's class."""
    name, prefix = component_name(library), library.prefix
    return f"""// SPDX-License-Identifier: Apache-2.0
// {_MADE}
#ifndef SUNPOINT_{name.upper()}_HPP
#define SUNPOINT_{name.upper()}_HPP

#include "{name}ComponentAc.hpp"
#include "{prefix}.h"

namespace Sunpoint {{

class {name} : public {name}ComponentBase {{
  public:
    explicit {name}(const char* name);

    //! Parameters from now on; false: out of their limits, those in force stay
    bool setParameters(const {prefix}_params& parameters);

  protected:
    //! What a step is given: to be filled in by the mission; false: no step
    virtual bool readInputs({prefix}_in& in) = 0;

    //! What becomes of the outputs of a step
    virtual void writeOutputs(const {prefix}_out& out) = 0;

  private:
    void schedIn_handler(FwIndexType portNum, U32 context) override;

    {prefix}_params m_parameters;
    {prefix}_state m_state;
}};

}}  // namespace Sunpoint

#endif
"""


def fprime_source(library: Library) -> str:
    """The component's code."""
    name, prefix = component_name(library), library.prefix
    return f"""// SPDX-License-Identifier: Apache-2.0
// {_MADE}
#include "{name}.hpp"

namespace Sunpoint {{

{name}::{name}(const char* name) : {name}ComponentBase(name), m_parameters({prefix}_mission), m_state() {{
    {prefix}_init(&this->m_state);
}}

bool {name}::setParameters(const {prefix}_params& parameters) {{
    const I32 row = {prefix}_check(&parameters);
    if (row != -1) {{
        this->log_WARNING_HI_ParametersRefused(row);
        return false;
    }}
    this->m_parameters = parameters;
    return true;
}}

void {name}::schedIn_handler(FwIndexType portNum, U32 context) {{
    (void)portNum;
    (void)context;
    {prefix}_in in = {prefix}_in();
    {prefix}_out out = {prefix}_out();
    if (this->readInputs(in)) {{
        {prefix}_step(&this->m_parameters, &this->m_state, &in, &out);
        this->writeOutputs(out);
    }}
}}

}}  // namespace Sunpoint
"""


def cfs_app(library: Library) -> str:
    """An application of cFS that makes a step for each message of inputs."""
    prefix = library.prefix
    upper = prefix.upper()
    return f"""/* SPDX-License-Identifier: Apache-2.0 */
/* {_MADE}
 * Numbers of messages come from the mission: {upper}_IN_MID and {upper}_OUT_MID.
 */
#include "cfe.h"
#include "{prefix}.h"

#include <string.h>

#ifndef {upper}_IN_MID
#define {upper}_IN_MID 0x18F0
#define {upper}_OUT_MID 0x08F0
#endif

typedef struct {{
    CFE_MSG_TelemetryHeader_t header;
    {prefix}_in in;
}} {prefix}_in_message;

typedef struct {{
    CFE_MSG_TelemetryHeader_t header;
    {prefix}_out out;
}} {prefix}_out_message;

static {prefix}_params params;
static {prefix}_state state;
static {prefix}_out_message sent;

void {prefix}_app_main(void);

static CFE_Status_t begin(CFE_SB_PipeId_t *pipe)
{{
    CFE_Status_t status = CFE_SB_CreatePipe(pipe, 16, "{prefix[:15]}");
    if (status == CFE_SUCCESS) {{
        status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId({upper}_IN_MID), *pipe);
    }}
    if (status == CFE_SUCCESS) {{
        status = CFE_MSG_Init(&sent.header.Msg, CFE_SB_ValueToMsgId({upper}_OUT_MID), sizeof sent);
    }}
    params = {prefix}_mission;
    {prefix}_init(&state);
    return status;
}}

static void take(const CFE_SB_Buffer_t *buffer)
{{
    {prefix}_in_message got;
    CFE_MSG_Size_t size = 0;
    if (CFE_MSG_GetSize(&buffer->Msg, &size) != CFE_SUCCESS || size != sizeof got) {{
        return;
    }}
    memcpy(&got, buffer, sizeof got);
    memset(&sent.out, 0, sizeof sent.out);
    {prefix}_step(&params, &state, &got.in, &sent.out);
    CFE_SB_TimeStampMsg(&sent.header.Msg);
    (void)CFE_SB_TransmitMsg(&sent.header.Msg, true);
}}

void {prefix}_app_main(void)
{{
    uint32 run = CFE_ES_RunStatus_APP_RUN;
    CFE_SB_PipeId_t pipe;
    CFE_SB_Buffer_t *buffer = NULL;
    if (begin(&pipe) != CFE_SUCCESS) {{
        run = CFE_ES_RunStatus_APP_ERROR;
    }}
    while (CFE_ES_RunLoop(&run)) {{
        if (CFE_SB_ReceiveBuffer(&buffer, pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {{
            take(buffer);
        }}
    }}
    CFE_ES_ExitApp(run);
}}
"""
