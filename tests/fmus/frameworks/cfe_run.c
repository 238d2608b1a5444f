/* Run the application with the golden inputs: sample by sample, a damaged one, commands, housekeeping; print what it sends. */
#include "NAME_app.h"
#include "golden.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

extern UPPER_Table_t CapitalTable;
static CFE_TBL_CallbackFuncPtr_t validate;
static union { CFE_SB_Buffer_t buffer; UPPER_Sample_t sample; CFE_MSG_CommandHeader_t command; } bus;
static int k;

static void post(uint32 id, uint32 size, uint32 code) {
  bus.buffer.Msg = (CFE_MSG_Message_t){id, size};
  bus.command.Code = code;
}

bool CFE_ES_RunLoop(uint32 *status) { return *status == CFE_ES_RunStatus_APP_RUN && k < GOLDEN_STEPS + 6; }
void CFE_ES_ExitApp(uint32 status) { printf("exit %u\n", status); }
CFE_Status_t CFE_EVS_Register(const void *f, uint16 n, uint16 s) { return (void)f, (void)n, (void)s, CFE_SUCCESS; }
CFE_Status_t CFE_EVS_SendEvent(uint16 id, uint16 type, const char *spec, ...) {
  va_list values;
  va_start(values, spec);
  printf("event %d %d ", id, type), vprintf(spec, values), puts("");
  va_end(values);
  return CFE_SUCCESS;
}
CFE_Status_t CFE_SB_CreatePipe(CFE_SB_PipeId_t *p, uint16 d, const char *n) { return *p = 7, (void)d, (void)n, CFE_SUCCESS; }
CFE_Status_t CFE_SB_Subscribe(CFE_SB_MsgId_t m, CFE_SB_PipeId_t p) { return printf("subscribed 0x%x\n", m.Value), p == 7 ? 0 : -1; }
CFE_Status_t CFE_SB_ReceiveBuffer(CFE_SB_Buffer_t **b, CFE_SB_PipeId_t p, int32 t) {
  (void)p, (void)t;
  if (k <= GOLDEN_STEPS) {
    NAME_real in[UPPER_N_INPUTS];
    for (int i = 0; i < UPPER_N_INPUTS; i++) in[i] = GOLDEN_INPUTS[k][i];
    NAME_to_inputs(in, &bus.sample.Payload);
    bus.sample.Payload.sequence = (uint32)k;
    NAME_seal(&bus.sample.Payload);
    post(UPPER_SAMPLE_MID, sizeof(UPPER_Sample_t), 0);
  } else if (k == GOLDEN_STEPS + 1) { /* as it was, but for one bit */
    bus.sample.Payload.sequence++;
    post(UPPER_SAMPLE_MID, sizeof(UPPER_Sample_t), 0);
  } else if (k == GOLDEN_STEPS + 2) {
    post(UPPER_SAMPLE_MID, sizeof(UPPER_Sample_t) - 1, 0);
  } else if (k == GOLDEN_STEPS + 3) {
    post(UPPER_CMD_MID, sizeof(CFE_MSG_CommandHeader_t), UPPER_NOOP_CC);
  } else if (k == GOLDEN_STEPS + 4) {
    post(UPPER_CMD_MID, sizeof(CFE_MSG_CommandHeader_t), UPPER_BEGIN_CC);
  } else {
    post(UPPER_SEND_HK_MID, sizeof(CFE_MSG_CommandHeader_t), 0);
  }
  k++;
  *b = &bus.buffer;
  return CFE_SUCCESS;
}
CFE_Status_t CFE_SB_TransmitMsg(const CFE_MSG_Message_t *m, bool o) {
  (void)o;
  if (m->Id == UPPER_RESULT_MID) {
    const UPPER_Result_t *r = (const UPPER_Result_t *)m;
    NAME_real out[UPPER_N_RESULTS];
    int different = 0;
    NAME_from_outputs(&r->Payload, out);
    for (int i = 0; i < UPPER_N_RESULTS; i++) different += k - 1 <= GOLDEN_STEPS && (double)out[i] != GOLDEN_RESULTS[k - 1][i];
    printf("result %u 0x%x %d\n", r->Payload.sequence, r->Payload.health, different);
  } else {
    const UPPER_HkTlm_t *h = (const UPPER_HkTlm_t *)m;
    printf("housekeeping %d %d %d 0x%x %u %u %u\n", h->CommandCounter, h->CommandErrorCounter, h->Begun, h->Health, h->Sequence,
           h->Counts[UPPER_COUNT_STEPS], h->Counts[UPPER_COUNT_REFUSED]);
  }
  return CFE_SUCCESS;
}
void CFE_SB_TimeStampMsg(CFE_MSG_Message_t *m) { (void)m; }
CFE_SB_MsgId_t CFE_SB_ValueToMsgId(CFE_SB_MsgId_Atom_t v) { return (CFE_SB_MsgId_t){v}; }
CFE_SB_MsgId_Atom_t CFE_SB_MsgIdToValue(CFE_SB_MsgId_t m) { return m.Value; }
CFE_Status_t CFE_MSG_Init(CFE_MSG_Message_t *m, CFE_SB_MsgId_t id, CFE_MSG_Size_t s) {
  return *m = (CFE_MSG_Message_t){id.Value, (uint32)s}, CFE_SUCCESS;
}
CFE_Status_t CFE_MSG_GetMsgId(const CFE_MSG_Message_t *m, CFE_SB_MsgId_t *id) { return id->Value = m->Id, CFE_SUCCESS; }
CFE_Status_t CFE_MSG_GetSize(const CFE_MSG_Message_t *m, CFE_MSG_Size_t *s) { return *s = m->Size, CFE_SUCCESS; }
CFE_Status_t CFE_MSG_GetFcnCode(const CFE_MSG_Message_t *m, CFE_MSG_FcnCode_t *c) {
  return *c = (uint16)((const CFE_MSG_CommandHeader_t *)m)->Code, CFE_SUCCESS;
}
CFE_Status_t CFE_TBL_Register(CFE_TBL_Handle_t *h, const char *n, size_t s, uint16 o, CFE_TBL_CallbackFuncPtr_t v) {
  return *h = 3, (void)n, (void)o, validate = v, s == sizeof CapitalTable ? CFE_SUCCESS : -1;
}
CFE_Status_t CFE_TBL_Load(CFE_TBL_Handle_t h, CFE_TBL_SrcEnum_t t, const void *s) {
  UPPER_Table_t wrong = CapitalTable;
  wrong.Period = -1;
  printf("validated %d %d\n", validate(&CapitalTable) == CFE_SUCCESS, validate(&wrong) == CFE_SUCCESS);
  return (void)h, (void)t, (void)s, CFE_SUCCESS;
}
CFE_Status_t CFE_TBL_Manage(CFE_TBL_Handle_t h) { return h == 3 ? CFE_SUCCESS : -1; }
CFE_Status_t CFE_TBL_GetAddress(void **p, CFE_TBL_Handle_t h) { return *p = &CapitalTable, h == 3 ? CFE_TBL_INFO_UPDATED : -1; }
CFE_Status_t CFE_TBL_ReleaseAddress(CFE_TBL_Handle_t h) { return h == 3 ? CFE_SUCCESS : -1; }

int main(void) { UPPER_Main(); }
