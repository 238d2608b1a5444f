/* A model that runs on a processor of its own, behind a pipe: in place of tables.h and of the functions that CasADi writes.

   resources/processor.txt says how to start it: seconds that it may take for an answer, then its program and its arguments, a
   line each; {resources} stands for their folder. It reads requests from its standard input, writes answers to its standard
   output (pipe.h), and ends with its input, so that nothing is left whatever becomes of the host. Each instance has one; what
   is known of it lies in the work space of its stepper. POSIX only. */

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stddef.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "pipe.h"
#include "resources.h"

#define PROCESSOR_FILE "processor.txt"
#define MOST_WORDS 64
#define PERIOD_UNTIL_KNOWN 3e-4 /* [s] */

#define casadi_int long long int

extern char **environ;
static const double *const tables = NULL;

typedef struct {
  pid_t pid;            /* 0: not started */
  int to, from, unused; /* ends of pipes; the unused one lets no write fail for want of a reader */
  double patience;      /* [s] */
  bool steps;           /* the period is known */
  char resources[4096]; /* where they are: two instances of one binary may have two places */
  pipe_request request;
  char why[512];
} Processor;

#undef SIZE_W
#define SIZE_W (sizeof(Processor) / sizeof(double) + 1)
#undef HAS_DERIVATIVES
#define HAS_DERIVATIVES 0
#define MODEL_FAILURE(s) (*((Processor *)(s)->w)->why ? ((Processor *)(s)->w)->why : NULL)
#define MODEL_RESOURCES(s, place) strcpy(((Processor *)(s)->w)->resources, place)
#define MODEL_END(s) processor_end((Processor *)(s)->w)
#define MODEL_CAN_BE_SAVED false
_Static_assert(sizeof(pipe_request) < 4096, "a request fits into a pipe");

static const char *tables_open(const char *resources) {
  bool fits = resources && strlen(resources) < sizeof ((Processor *)NULL)->resources;
  return fits ? NULL : "the host does not say where the FMU's resources are";
}
static void tables_close(void) {}

static double seconds_now(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* End it, and take note of its end: first by the end of its input, then by force. */
static int processor_stop(Processor *p, double patience) {
  int status = 0;
  if (!p->pid) return 0;
  close(p->to), close(p->from), close(p->unused);
  for (double end = seconds_now() + patience; waitpid(p->pid, &status, WNOHANG) == 0;) {
    if (seconds_now() > end) kill(-p->pid, SIGKILL); /* with what it started */
    nanosleep(&(struct timespec){0, 1000000}, NULL);
  }
  p->pid = 0;
  return status;
}

static void processor_end(Processor *p) {
  processor_stop(p, 2.0);
  *p->why = '\0';
}

static bool pipe_between(int ends[2]) {
  if (pipe(ends)) return false;
  fcntl(ends[0], F_SETFD, FD_CLOEXEC), fcntl(ends[1], F_SETFD, FD_CLOEXEC);
  return true;
}

static int processor_start(Processor *p) {
  char path[4096], text[8192], *words[MOST_WORDS + 1];
  int to[2], from[2], n = 0, error;
  size_t size;
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  FILE *file = resource_path(p->resources, PROCESSOR_FILE, path, sizeof path) ? fopen(path, "r") : NULL;
  if (!file) return snprintf(p->why, sizeof p->why, "cannot read %s in the FMU's resources. Unpack the whole FMU.", PROCESSOR_FILE);
  path[strlen(path) - strlen("/" PROCESSOR_FILE)] = '\0';
  size = 0;
  for (char line[1024]; fgets(line, sizeof line, file) && n <= MOST_WORDS;) {
    const char *begin = strncmp(line, "{resources}", 11) == 0 ? path : "", *rest = line + (*begin ? 11 : 0);
    line[strcspn(line, "\r\n")] = '\0';
    if (!*line || *line == '#' || size + strlen(begin) + strlen(rest) + 1 > sizeof text) continue;
    words[n++] = text + size;
    size += (size_t)snprintf(text + size, sizeof text - size, "%s%s", begin, rest) + 1;
  }
  fclose(file);
  p->patience = n > 1 ? atof(words[0]) : 0.0;
  if (!(p->patience > 0.0) || n > MOST_WORDS) {
    return snprintf(p->why, sizeof p->why, "%s must hold seconds, a program and its arguments, a line each", PROCESSOR_FILE);
  }
  words[n] = NULL;
  if (!pipe_between(to)) return snprintf(p->why, sizeof p->why, "there is no pipe to be had: %s", strerror(errno));
  if (!pipe_between(from)) {
    close(to[0]), close(to[1]);
    return snprintf(p->why, sizeof p->why, "there is no pipe to be had: %s", strerror(errno));
  }
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, to[0], 0);
  posix_spawn_file_actions_adddup2(&actions, from[1], 1);
  posix_spawnattr_init(&attributes); /* what interrupts the host in a terminal interrupts no step */
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  error = posix_spawnp(&p->pid, words[1], &actions, &attributes, words + 1, environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  close(from[1]);
  p->to = to[1], p->from = from[0], p->unused = to[0];
  if (!error) return 0;
  p->pid = 0;
  close(p->to), close(p->from), close(p->unused);
  return snprintf(p->why, sizeof p->why,
                  "cannot start %s, which model '%s' runs on: %s. Install it (Debian: apt install qemu-system-arm), or name "
                  "another one in %s of the FMU's resources.",
                  words[1], MODEL_NAME, strerror(error), PROCESSOR_FILE);
}

/* Read an answer whole, in time. Returns 0, or a positive number where there is none. */
static int processor_answer(Processor *p, pipe_answer *answer) {
  double end = seconds_now() + p->patience;
  for (size_t done = 0; done < sizeof *answer;) {
    struct pollfd from = {p->from, POLLIN, 0};
    double left = end - seconds_now();
    int ready = poll(&from, 1, left > 0.0 ? (int)(1e3 * left) + 1 : 0);
    ssize_t n = ready > 0 ? read(p->from, (char *)answer + done, sizeof *answer - done) : -1;
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0) {
      processor_stop(p, 0.0);
      return snprintf(p->why, sizeof p->why, "the processor of model '%s' did not answer within %g s and was ended", MODEL_NAME,
                      p->patience);
    }
    if (n <= 0) {
      int status = processor_stop(p, 1.0);
      return snprintf(p->why, sizeof p->why, "the processor of model '%s' ended before it answered (%s %d). Run it again.", MODEL_NAME,
                      WIFSIGNALED(status) ? "signal" : "code", WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
    }
    done += (size_t)n;
  }
  return 0;
}

/* Send the request, and write the results in the order of the FMU's table: health follows the outputs. */
static int processor_ask(Processor *p, double *results) {
  const uint8_t *bytes = (const uint8_t *)&p->request.inputs;
  pipe_answer answer;
  *p->why = '\0';
  p->request.magic = PIPE_MAGIC;
  p->request.inputs.crc = crc32(bytes, offsetof(component_inputs, crc));
  if (!p->pid && !p->request.begins) {
    return snprintf(p->why, sizeof p->why, "the processor of model '%s' has ended, and its state with it. Reset the model.", MODEL_NAME);
  }
  if (!p->pid && processor_start(p)) return 1;
  (void)!write(p->to, &p->request, sizeof p->request); /* that nobody reads it is seen by the answer */
  if (processor_answer(p, &answer)) return 1;
  if (answer.magic != PIPE_MAGIC || answer.sequence != p->request.inputs.sequence) {
    processor_stop(p, 0.0);
    return snprintf(p->why, sizeof p->why, "the processor of model '%s' sent what is no answer and was ended", MODEL_NAME);
  }
  if (p->request.begins && (answer.health & COMPONENT_LOST)) {
    return snprintf(p->why, sizeof p->why,
                    "the component of model '%s' refused its parameters or first sample (health 0x%x). Correct them.", MODEL_NAME,
                    (unsigned)answer.health);
  }
  if (answer.health & (COMPONENT_LOST | COMPONENT_FAILED)) { /* no results, or those of the step before */
    return snprintf(p->why, sizeof p->why, "the component of model '%s' says %s (health 0x%x) of sample %u. Reset the model.", MODEL_NAME,
                    answer.health & COMPONENT_LOST ? "that its state is lost" : "that its step failed", (unsigned)answer.health,
                    (unsigned)answer.sequence);
  }
  for (int i = 0; i < N_RESULTS; i++) {
    results[i] = i == HEALTH ? answer.health : (double)answer.results[i < HEALTH ? i : i - 1];
  }
  return 0;
}

static void processor_sample(Processor *p, const double *inputs) {
  component_real numbers[COMPONENT_N_INPUTS];
  for (int i = 0; i < COMPONENT_N_INPUTS; i++) numbers[i] = (component_real)inputs[i];
  component_to_inputs(numbers, &p->request.inputs);
}

static int init(const double **arg, double **res, casadi_int *iw, double *w, int mem) {
  Processor *p = (Processor *)w;
  component_real numbers[COMPONENT_N_PARAMETERS];
  (void)iw, (void)mem;
  for (int i = 0; i < COMPONENT_N_PARAMETERS; i++) numbers[i] = (component_real)arg[1][i];
  component_to_parameters(numbers, &p->request.parameters);
  processor_sample(p, arg[0]);
  p->request.inputs.sequence = 0;
  p->request.period = PERIOD_UNTIL_KNOWN; /* it is not needed yet */
  p->request.begins = 1;
  p->steps = false;
  res[0][0] = 0.0;
  return processor_ask(p, res[1]);
}

static int step(const double **arg, double **res, casadi_int *iw, double *w, int mem) {
  Processor *p = (Processor *)w;
  (void)iw, (void)mem;
  res[0][0] = 0.0;
  if (!p->steps) { /* begin again, with the period: FMI 2.0 says it with the first step */
    p->request.period = *arg[3];
    if (processor_ask(p, res[1])) return 1;
    p->steps = true;
    p->request.begins = 0;
  }
  *p->why = '\0';
  if (fabs(*arg[3] - p->request.period) > 1e-9 * p->request.period) {
    return snprintf(p->why, sizeof p->why,
                    "a step of %g s is not the period of the processor of model '%s', which is that of its first step, %g s", *arg[3],
                    MODEL_NAME, p->request.period);
  }
  processor_sample(p, arg[1]);
  p->request.inputs.sequence++;
  return processor_ask(p, res[1]);
}
