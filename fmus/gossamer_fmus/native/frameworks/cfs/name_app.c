/* {{description}} as a cFS application. Written by gossamer flight; see {{name}}_app.h. */
#include "{{name}}_app.h"

#include <string.h>

static struct {
  uint32 RunStatus;
  CFE_SB_PipeId_t Pipe;
  CFE_TBL_Handle_t Table;
  {{name}} Component;
  {{name}}_work Work;
  {{NAME}}_Result_t Result;
  {{NAME}}_HkTlm_t Hk;
} {{NAME}}_Data;

static bool Within({{name}}_real Value, {{name}}_real Low, {{name}}_real High) { return (Value >= Low) && (Value <= High); }

/* Refuse a table with a number that is out of its range. */
static int32 {{NAME}}_ValidateTable(void *TblData) {
  const {{NAME}}_Table_t *t = TblData;
  bool Valid = Within(t->Period, {{smallest}}, {{largest}});
{{ranges}}
  if (!Valid) {
    CFE_EVS_SendEvent({{NAME}}_TABLE_ERR_EID, CFE_EVS_EventType_ERROR, "{{NAME}}: a number of the table is out of its range");
  }
  return Valid ? CFE_SUCCESS : CFE_STATUS_VALIDATION_FAILURE;
}

static int32 {{NAME}}_Init(void) {
  static const CFE_SB_MsgId_Atom_t Wanted[] = {{{NAME}}_CMD_MID, {{NAME}}_SEND_HK_MID, {{NAME}}_SAMPLE_MID};
  memset(&{{NAME}}_Data, 0, sizeof({{NAME}}_Data));
  {{NAME}}_Data.RunStatus = CFE_ES_RunStatus_APP_RUN;
  int32 Status = CFE_EVS_Register(NULL, 0, CFE_EVS_EventFilter_BINARY);
  if (Status == CFE_SUCCESS) {
    Status = CFE_SB_CreatePipe(&{{NAME}}_Data.Pipe, {{NAME}}_PIPE_DEPTH, "{{NAME}}_PIPE");
  }
  for (uint32 i = 0; (Status == CFE_SUCCESS) && (i < (sizeof(Wanted) / sizeof(Wanted[0]))); i++) {
    Status = CFE_SB_Subscribe(CFE_SB_ValueToMsgId(Wanted[i]), {{NAME}}_Data.Pipe);
  }
  if (Status == CFE_SUCCESS) {
    Status = CFE_TBL_Register(&{{NAME}}_Data.Table, "Parameters", sizeof({{NAME}}_Table_t), CFE_TBL_OPT_DEFAULT,
                              {{NAME}}_ValidateTable);
  }
  if (Status == CFE_SUCCESS) {
    Status = CFE_TBL_Load({{NAME}}_Data.Table, CFE_TBL_SRC_FILE, {{NAME}}_TABLE_FILE);
  }
  if (Status == CFE_SUCCESS) {
    CFE_MSG_Init(CFE_MSG_PTR({{NAME}}_Data.Hk.Header), CFE_SB_ValueToMsgId({{NAME}}_HK_TLM_MID), sizeof({{NAME}}_Data.Hk));
    CFE_MSG_Init(CFE_MSG_PTR({{NAME}}_Data.Result.Header), CFE_SB_ValueToMsgId({{NAME}}_RESULT_MID),
                 sizeof({{NAME}}_Data.Result));
    CFE_EVS_SendEvent({{NAME}}_STARTUP_INF_EID, CFE_EVS_EventType_INFORMATION, "{{NAME}}: model 0x%08lx waits for samples",
                      (unsigned long){{NAME}}_VERSION);
  }
  return Status;
}

/* Begin with a sample and the numbers of the table. */
static void {{NAME}}_Begin(const {{name}}_inputs *Sample) {
  {{NAME}}_Table_t *Table = NULL;
  {{name}}_outputs *y = &{{NAME}}_Data.Result.Payload;
  const int32 Status = CFE_TBL_GetAddress((void **)&Table, {{NAME}}_Data.Table);
  y->health = {{NAME}}_LOST;
  if ((Status == CFE_SUCCESS) || (Status == CFE_TBL_INFO_UPDATED)) {
    y->health = {{name}}_init(&{{NAME}}_Data.Component, &Table->Parameters, Table->Period, Sample, &{{NAME}}_Data.Work);
    CFE_TBL_ReleaseAddress({{NAME}}_Data.Table);
  }
  {{name}}_to_outputs({{NAME}}_Data.Component.first.results, y);
  y->sequence = Sample->sequence;
  y->crc = 0U; /* results of a beginning are not sealed */
  {{NAME}}_Data.Hk.Begun = ((y->health & ({{NAME}}_LOST | {{NAME}}_CONSTANTS)) == 0U) ? 1U : 0U;
  if ({{NAME}}_Data.Hk.Begun != 0U) {
    CFE_EVS_SendEvent({{NAME}}_BEGAN_INF_EID, CFE_EVS_EventType_INFORMATION, "{{NAME}}: began with sample %lu",
                      (unsigned long)Sample->sequence);
  }
}

static void {{NAME}}_Take(const {{name}}_inputs *Sample) {
  {{name}}_outputs *y = &{{NAME}}_Data.Result.Payload;
  if ({{NAME}}_Data.Hk.Begun != 0U) {
    (void){{name}}_step(&{{NAME}}_Data.Component, Sample, y, &{{NAME}}_Data.Work);
  } else {
    {{NAME}}_Begin(Sample);
  }
  if (y->health != {{NAME}}_Data.Hk.Health) {
    CFE_EVS_SendEvent({{NAME}}_HEALTH_ERR_EID, CFE_EVS_EventType_ERROR, "{{NAME}}: health 0x%03lx at sample %lu",
                      (unsigned long)y->health, (unsigned long)Sample->sequence);
    {{NAME}}_Data.Hk.Health = y->health;
  }
  CFE_SB_TimeStampMsg(CFE_MSG_PTR({{NAME}}_Data.Result.Header));
  CFE_SB_TransmitMsg(CFE_MSG_PTR({{NAME}}_Data.Result.Header), true);
}

static void {{NAME}}_ReportHousekeeping(void) {
  {{NAME}}_Data.Hk.Sequence = {{NAME}}_Data.Component.first.sequence;
  memcpy({{NAME}}_Data.Hk.Counts, {{NAME}}_Data.Component.first.counts, sizeof({{NAME}}_Data.Hk.Counts));
  CFE_SB_TimeStampMsg(CFE_MSG_PTR({{NAME}}_Data.Hk.Header));
  CFE_SB_TransmitMsg(CFE_MSG_PTR({{NAME}}_Data.Hk.Header), true);
  CFE_TBL_Manage({{NAME}}_Data.Table); /* validates and loads what the ground has sent; it holds from the next beginning on */
}

static void {{NAME}}_Command(const CFE_MSG_Message_t *Msg, size_t Size) {
  CFE_MSG_FcnCode_t Code = 0;
  CFE_MSG_GetFcnCode(Msg, &Code);
  if ((Size != sizeof(CFE_MSG_CommandHeader_t)) || (Code > {{NAME}}_BEGIN_CC)) {
    {{NAME}}_Data.Hk.CommandErrorCounter++;
    CFE_EVS_SendEvent({{NAME}}_COMMAND_ERR_EID, CFE_EVS_EventType_ERROR, "{{NAME}}: no command %u of %u bytes", (unsigned int)Code,
                      (unsigned int)Size);
  } else if (Code == {{NAME}}_RESET_COUNTERS_CC) {
    {{NAME}}_Data.Hk.CommandCounter = 0;
    {{NAME}}_Data.Hk.CommandErrorCounter = 0;
  } else {
    {{NAME}}_Data.Hk.CommandCounter++;
    {{NAME}}_Data.Hk.Begun = (Code == {{NAME}}_BEGIN_CC) ? 0U : {{NAME}}_Data.Hk.Begun;
    CFE_EVS_SendEvent({{NAME}}_COMMAND_INF_EID, CFE_EVS_EventType_INFORMATION, "{{NAME}}: command %u", (unsigned int)Code);
  }
}

static void {{NAME}}_Process(const CFE_SB_Buffer_t *Buffer) {
  CFE_SB_MsgId_t MsgId = CFE_SB_INVALID_MSG_ID;
  CFE_MSG_Size_t Size = 0;
  CFE_MSG_GetMsgId(&Buffer->Msg, &MsgId);
  CFE_MSG_GetSize(&Buffer->Msg, &Size);
  const CFE_SB_MsgId_Atom_t Id = CFE_SB_MsgIdToValue(MsgId);
  if ((Id == {{NAME}}_SAMPLE_MID) && (Size == sizeof({{NAME}}_Sample_t))) {
    {{NAME}}_Take(&((const {{NAME}}_Sample_t *)Buffer)->Payload);
  } else if (Id == {{NAME}}_SEND_HK_MID) {
    {{NAME}}_ReportHousekeeping();
  } else if (Id == {{NAME}}_CMD_MID) {
    {{NAME}}_Command(&Buffer->Msg, Size);
  } else {
    {{NAME}}_Data.Hk.CommandErrorCounter++;
    CFE_EVS_SendEvent({{NAME}}_COMMAND_ERR_EID, CFE_EVS_EventType_ERROR, "{{NAME}}: message 0x%x of %u bytes is none of ours",
                      (unsigned int)Id, (unsigned int)Size);
  }
}

void {{NAME}}_Main(void) {
  CFE_SB_Buffer_t *Buffer = NULL;
  if ({{NAME}}_Init() != CFE_SUCCESS) {
    {{NAME}}_Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
  }
  while (CFE_ES_RunLoop(&{{NAME}}_Data.RunStatus)) {
    if (CFE_SB_ReceiveBuffer(&Buffer, {{NAME}}_Data.Pipe, CFE_SB_PEND_FOREVER) == CFE_SUCCESS) {
      {{NAME}}_Process(Buffer);
    } else {
      {{NAME}}_Data.RunStatus = CFE_ES_RunStatus_APP_ERROR;
    }
  }
  CFE_ES_ExitApp({{NAME}}_Data.RunStatus);
}
