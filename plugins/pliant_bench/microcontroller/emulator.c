/* The microcontroller with a finger, on a computer: standard input and output are its serial line.
 *
 *   emulator LOG [STEP_MS] [IDLE_S]
 *
 * LOG gets a line for every change of the valve: milliseconds of CLOCK_MONOTONIC, and the pressure; and a line "# late MS
 * GAP" where this program itself was not run for GAP milliseconds, as on a busy computer. With STEP_MS above 0
 * time does not pass by itself, but by STEP_MS after each line that comes, so that runs need no waiting. The program ends
 * when no byte has come for IDLE_S (3600). The finger is one joint with the law of the published study and a damper of 0.3 s;
 * its sensor has noise of half a milliradian. */

#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "pliant_bench.h"

static const pliant_input INPUTS[] = {{"pressure_pa", 0, 0, 15000, 20000}};
static const pliant_output OUTPUTS[] = {{"angle_rad", -2.6f, 2.6f}};
static const pliant_bench BENCH = {"emulator", INPUTS, 1, OUTPUTS, 1, 500};

/* It ends so long after its connection, or the last program at its terminal, was gone; vented by then. */
#define CLOSED_MS 2000u
#define HUNG_UP_MS 60000u

static FILE *log_file;
static uint32_t step_ms, virtual_ms;
static double pressure_pa, angle_rad;
static unsigned char bytes[256];
static int byte_count, byte_next, line_ended, is_hung_up, is_closed;
static uint64_t start_ms, heard_ms;
static volatile sig_atomic_t ended;

static uint64_t clock_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (uint64_t)now.tv_sec * 1000u + (uint64_t)now.tv_nsec / 1000000u;
}

uint32_t pliant_millis(void) { return step_ms ? virtual_ms : (uint32_t)(clock_ms() - start_ms); }

float pliant_read_sensor(uint8_t output) {
  static uint32_t random = 1;
  (void)output;
  random = random * 1664525u + 1013904223u;
  return (float)(angle_rad + 1e-3 * ((double)random / 4294967296.0 - 0.5));
}

void pliant_write_valve(uint8_t input, float value) {
  (void)input;
  pressure_pa = value;
  fprintf(log_file, "%llu %.6f\n", (unsigned long long)(step_ms ? virtual_ms : clock_ms()), pressure_pa);
}

int pliant_serial_read(void) {
  if (step_ms && line_ended) return -1; /* one line, then time passes */
  if (byte_next >= byte_count) {
    struct pollfd input = {STDIN_FILENO, POLLIN, 0};
    int is_waiting = poll(&input, 1, 0) > 0;
    ssize_t n = is_waiting ? read(STDIN_FILENO, bytes, sizeof bytes) : 0;
    is_hung_up = is_waiting && n <= 0;
    is_closed = is_waiting && n == 0; /* a TCP connection; a terminal may be opened again */
    if (n <= 0) return -1;
    byte_next = 0;
    byte_count = (int)n;
    heard_ms = clock_ms();
  }
  line_ended = bytes[byte_next] == '\n';
  return bytes[byte_next++];
}

static unsigned char answer[256];
static int answer_length;

void pliant_serial_write(uint8_t byte) {
  answer[answer_length++] = byte;
  if (byte == '\n' || answer_length == (int)sizeof answer) {
    if (write(STDOUT_FILENO, answer, (size_t)answer_length) < 0) { /* the computer is gone: silence follows */
    }
    answer_length = 0;
  }
}

/* c u' = k_n p + m_a p u - (m_e u|u| / 2 + b_e u), in steps of a millisecond at most */
static void pass(double seconds) {
  int steps = (int)ceil(seconds / 1e-3);
  for (int k = 0; k < steps; k++) {
    double u = angle_rad, p = pressure_pa;
    double effort = 1.637e-6 * p - 1.704e-6 * p * u - (0.5 * 0.1012 * u * fabs(u) + 0.0245 * u);
    angle_rad += seconds / steps * effort / (0.3 * 0.0245);
  }
}

static void end(int signal_number) {
  (void)signal_number;
  ended = 1;
}

int main(int argc, char **argv) {
  if (argc < 2 || !(log_file = fopen(argv[1], "w"))) {
    fprintf(stderr, "usage: emulator LOG [STEP_MS] [IDLE_S]\n");
    return 2;
  }
  step_ms = argc > 2 ? (uint32_t)atoi(argv[2]) : 0;
  uint64_t idle_ms = 1000u * (uint64_t)(argc > 3 ? atoi(argv[3]) : 3600);
  signal(SIGTERM, end);
  signal(SIGINT, end);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGHUP, SIG_IGN);
  start_ms = clock_ms();
  heard_ms = start_ms;
  uint64_t passed_ms = start_ms;
  pliant_setup(&BENCH);
  while (!ended && clock_ms() - heard_ms < (is_closed ? CLOSED_MS : is_hung_up ? HUNG_UP_MS : idle_ms)) {
    struct pollfd input = {STDIN_FILENO, POLLIN, 0};
    if (is_hung_up) usleep(1000); /* no bytes come, time goes on */
    else if (byte_next >= byte_count) poll(&input, 1, 1);
    if (!step_ms) { /* under the pressure until now, before it changes */
      uint64_t now = clock_ms();
      pass((double)(now - passed_ms) * 1e-3);
      if (now - passed_ms > 10) fprintf(log_file, "# late %llu %u\n", (unsigned long long)now, (unsigned)(now - passed_ms));
      passed_ms = now;
    }
    line_ended = 0;
    pliant_loop();
    for (uint32_t k = 0; line_ended && k < step_ms; k++) {
      virtual_ms++;
      pass(1e-3);
      pliant_loop();
    }
    fflush(log_file);
  }
  fclose(log_file);
  return 0;
}
