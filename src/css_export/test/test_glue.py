# SPDX-License-Identifier: Apache-2.0
"""The skeletons for flight-software frameworks compile against declarations of what they use of these."""

import shutil

import pytest

from css_common.mission import load_mission
from css_export.flown import flying_functions
from css_export.glue import component_name, fpp, write_glue
from css_export.library import made_library, write_library
from css_export.programs import compiled_object
from css_export.targets import TARGETS

HOST = TARGETS["x86_64"]
CFE = """
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
typedef uint32_t uint32;
typedef int32_t CFE_Status_t;
typedef uint32_t CFE_SB_PipeId_t;
typedef uint32_t CFE_SB_MsgId_t;
typedef size_t CFE_MSG_Size_t;
typedef struct { uint8_t bytes[8]; } CFE_MSG_Message_t;
typedef struct { CFE_MSG_Message_t Msg; uint8_t seconds[8]; } CFE_MSG_TelemetryHeader_t;
typedef union { CFE_MSG_Message_t Msg; double aligned; } CFE_SB_Buffer_t;
#define CFE_SUCCESS 0
#define CFE_SB_PEND_FOREVER (-1)
#define CFE_ES_RunStatus_APP_RUN 1
#define CFE_ES_RunStatus_APP_ERROR 3
CFE_SB_MsgId_t CFE_SB_ValueToMsgId(uint32_t value);
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *pipe, uint16_t depth, const char *name);
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t id, CFE_SB_PipeId_t pipe);
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **buffer, CFE_SB_PipeId_t pipe, int32_t wait);
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *message, bool count);
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *message);
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *message, CFE_SB_MsgId_t id, CFE_MSG_Size_t size);
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *message, CFE_MSG_Size_t *size);
bool CFE_ES_RunLoop(uint32 *status);
void CFE_ES_ExitApp(uint32 status);
"""
FPRIME = """
#include <cstdint>
typedef std::int32_t I32;
typedef std::uint32_t U32;
typedef std::int16_t FwIndexType;
namespace Sunpoint {
class %sComponentBase {
  public:
    explicit %sComponentBase(const char* name);
    virtual ~%sComponentBase();
  protected:
    virtual void schedIn_handler(FwIndexType portNum, U32 context) = 0;
    void log_WARNING_HI_ParametersRefused(I32 row);
};
}
"""


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A small library with its skeletons."""
    folder = tmp_path_factory.mktemp("glue")
    functions = flying_functions(load_mission("esprit_2006"), ["slit_sun_angle"])
    library = made_library(load_mission("esprit_2006"), functions[0])
    write_library(library, [], folder)
    write_glue(library, folder)
    return library, folder


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_the_cfs_application_compiles(exported, tmp_path):
    library, folder = exported
    (folder / "cfs" / "cfe.h").write_text(CFE)
    (folder / "cfs" / f"{library.prefix}.h").write_text(library.header())
    compiled_object(HOST, folder / "cfs" / f"{library.prefix}_app.c", tmp_path / "app.o")


@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_the_fprime_component_compiles(exported, tmp_path):
    library, folder = exported
    name = component_name(library)
    (folder / "fprime" / f"{name}ComponentAc.hpp").write_text(FPRIME % (name, name, name))
    (folder / "fprime" / f"{library.prefix}.h").write_text(library.header())
    compiled_object(HOST, folder / "fprime" / f"{name}.cpp", tmp_path / "component.o", cplusplus=True)


def test_the_model_names_what_the_code_uses(exported):
    library, _ = exported
    text = fpp(library)
    assert f"passive component {component_name(library)} " in text
    for word in ("schedIn: Svc.Sched", "ParametersRefused(row: I32)"):
        assert word in text
