/* What a host and a component on a processor of its own send each other: a request, an answer. Both have the lowest byte first. */
#include "component.h"

#define PIPE_MAGIC (0x50495045U ^ COMPONENT_VERSION)

typedef struct {
  uint32_t magic;
  uint32_t begins; /* 1: init; 0: step */
  double period;   /* [s], of init */
  component_parameters parameters;
  component_inputs inputs;
} pipe_request;

typedef struct {
  uint32_t magic;
  uint32_t sequence; /* that of the request */
  uint32_t health;
  uint32_t zero;
  component_real results[COMPONENT_N_RESULTS];
} pipe_answer;
