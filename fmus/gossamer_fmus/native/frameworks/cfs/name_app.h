/* {{description}} as a cFS application. Written by gossamer flight; units and ranges are those of INTERFACE.md. */
#ifndef {{NAME}}_APP_H
#define {{NAME}}_APP_H

#include "cfe.h"

#include "{{name}}.h"

/* Message numbers and codes; change them where your mission uses these. */
#ifndef {{NAME}}_CMD_MID
#define {{NAME}}_CMD_MID 0x18A0     /* commands */
#define {{NAME}}_SEND_HK_MID 0x18A1 /* housekeeping is wanted */
#define {{NAME}}_SAMPLE_MID 0x18A2  /* a sample, sealed where it was measured */
#define {{NAME}}_HK_TLM_MID 0x08A0
#define {{NAME}}_RESULT_MID 0x08A1
#endif
#define {{NAME}}_NOOP_CC 0
#define {{NAME}}_RESET_COUNTERS_CC 1
#define {{NAME}}_BEGIN_CC 2 /* begin again with the next sample and the present table */
#define {{NAME}}_PIPE_DEPTH 32
#define {{NAME}}_TABLE_FILE "/cf/{{name}}_tbl.tbl"

/* Events. */
#define {{NAME}}_STARTUP_INF_EID 1
#define {{NAME}}_BEGAN_INF_EID 2
#define {{NAME}}_HEALTH_ERR_EID 3
#define {{NAME}}_COMMAND_INF_EID 4
#define {{NAME}}_COMMAND_ERR_EID 5
#define {{NAME}}_TABLE_ERR_EID 6

typedef struct {
  {{name}}_real Period; /* [s] */
  {{name}}_parameters Parameters;
} {{NAME}}_Table_t;

typedef struct {
  CFE_MSG_CommandHeader_t Header;
  {{name}}_inputs Payload;
} {{NAME}}_Sample_t;

typedef struct {
  CFE_MSG_TelemetryHeader_t Header;
  {{name}}_outputs Payload;
} {{NAME}}_Result_t;

typedef struct { /* housekeeping: counts since init, see {{NAME}}_COUNT_STEPS and the following of {{name}}.h */
  CFE_MSG_TelemetryHeader_t Header;
  uint8 CommandCounter;
  uint8 CommandErrorCounter;
  uint8 Begun;
  uint8 Spare;
  uint32 Health;
  uint32 Sequence;
  uint32 Counts[{{NAME}}_N_COUNTS];
} {{NAME}}_HkTlm_t;

void {{NAME}}_Main(void);

#endif
