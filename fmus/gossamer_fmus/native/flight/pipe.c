/* A component on the emulated board, sample by sample: requests come from the standard input of the emulator, answers go to its
   standard output. It ends with its input. On a board of your own replace the two functions by those of a serial line. */

#include "pipe.h"

#include <fcntl.h>
#include <unistd.h>

static int from_host, to_host;

static bool receive(void *bytes, size_t size) {
  size_t done = 0U;
  while (done < size) {
    const int n = (int)read(from_host, (char *)bytes + done, size - done);
    if (n <= 0) return false;
    done += (size_t)n;
  }
  return true;
}

static bool send(const void *bytes, size_t size) {
  size_t done = 0U;
  while (done < size) {
    const int n = (int)write(to_host, (const char *)bytes + done, size - done);
    if (n <= 0) return false;
    done += (size_t)n;
  }
  return true;
}

int main(void) {
  static component c;
  static component_work work;
  static pipe_request request;
  pipe_answer answer = {PIPE_MAGIC, 0U, 0U, 0U, {(component_real)0}};
  from_host = open("/dev/stdin", O_RDONLY);
  to_host = open("/dev/stdout", O_WRONLY);
  while (receive(&request, sizeof request)) {
    if (request.magic != PIPE_MAGIC) return 2;
    if (request.begins != 0U) {
      answer.health = component_init(&c, &request.parameters, (component_real)request.period, &request.inputs, &work);
      for (int i = 0; i < COMPONENT_N_RESULTS; i++) answer.results[i] = c.first.results[i];
    } else {
      component_outputs y;
      answer.health = component_step(&c, &request.inputs, &y, &work);
      component_from_outputs(&y, answer.results);
    }
    answer.sequence = request.inputs.sequence;
    if (!send(&answer, sizeof answer)) return 3;
  }
  return 0;
}
