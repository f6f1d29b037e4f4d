/* See pliant_bench.h. A line is "SEQUENCE BODY*CRC\n", the CRC-32 in eight hexadecimal digits, of all before the star. */

#include "pliant_bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LINE_SIZE 112
#define ANSWER_SIZE 176
#define LONGEST_STEP_S 0.05f /* after a longer pause of the loop the valve still moves as far as in this time */

/* NEW: no hello yet since the start. READY: vented. ACTIVE: valves follow lines. SILENT: vented because no line came. */
enum { NEW, READY, ACTIVE, SILENT };

static const pliant_bench *bench;
static uint8_t state;
static float target[PLIANT_MAX_INPUTS], valve[PLIANT_MAX_INPUTS], speed[PLIANT_MAX_INPUTS]; /* per second */
static uint32_t moved_ms, heard_ms;
static uint16_t last_sequence;
static uint32_t session;
static char line[LINE_SIZE], answer[ANSWER_SIZE];
static uint8_t line_length, line_too_long;
static uint8_t answer_length;

static uint32_t crc32(const char *text, uint8_t length) {
  uint32_t crc = 0xFFFFFFFFu;
  for (uint8_t i = 0; i < length; i++) {
    crc ^= (uint8_t)text[i];
    for (uint8_t bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
  }
  return ~crc;
}

/* Writing the answer */

static void put(char c) {
  if (answer_length < ANSWER_SIZE) answer[answer_length++] = c;
}

static void put_text(const char *text) {
  while (*text) put(*text++);
}

static void put_unsigned(uint32_t value) {
  char digits[10];
  uint8_t n = 0;
  do digits[n++] = (char)('0' + value % 10);
  while (value /= 10);
  while (n) put(digits[--n]);
}

/* Six decimals: a micropascal, or a microradian. */
static void put_number(float value) {
  if (isnan(value)) {
    put_text("nan");
    return;
  }
  if (value < 0) put('-');
  if (value < 0) value = -value;
  if (value > 4e9f) {
    put_text("inf");
    return;
  }
  uint32_t whole = (uint32_t)value;
  uint32_t part = (uint32_t)((value - (float)whole) * 1e6f + 0.5f);
  if (part >= 1000000u) {
    whole++;
    part -= 1000000u;
  }
  put_unsigned(whole);
  put('.');
  for (uint32_t place = 100000u; place; place /= 10) put((char)('0' + part / place % 10));
}

static void put_field(float value) {
  put(' ');
  put_number(value);
}

static void begin_answer(uint16_t sequence, char kind) {
  answer_length = 0;
  put_unsigned(sequence);
  put(' ');
  put(kind);
}

static void send_answer(void) {
  uint32_t crc = crc32(answer, answer_length);
  for (uint8_t i = 0; i < answer_length; i++) pliant_serial_write((uint8_t)answer[i]);
  pliant_serial_write('*');
  for (int8_t shift = 28; shift >= 0; shift -= 4) pliant_serial_write((uint8_t)"0123456789ABCDEF"[(crc >> shift) & 15]);
  pliant_serial_write('\n');
}

static void refuse(uint16_t sequence, const char *why) {
  begin_answer(sequence, 'E');
  put(' ');
  put_text(why);
}

/* Valves */

static void vent(uint8_t next) {
  for (uint8_t k = 0; k < bench->input_count; k++) {
    target[k] = valve[k] = bench->inputs[k].rest;
    pliant_write_valve(k, valve[k]);
  }
  state = next;
}

static void move_valves(void) {
  uint32_t now = pliant_millis();
  float passed_s = (float)(now - moved_ms) * 1e-3f;
  moved_ms = now;
  if (passed_s > LONGEST_STEP_S) passed_s = LONGEST_STEP_S;
  for (uint8_t k = 0; k < bench->input_count; k++) {
    float change = target[k] - valve[k];
    float most = isinf(speed[k]) ? fabsf(change) : speed[k] * passed_s;
    if (change == 0 || most == 0) continue;
    valve[k] = fabsf(change) <= most ? target[k] : valve[k] + (change > 0 ? most : -most);
    pliant_write_valve(k, valve[k]);
  }
}

/* Requests */

static void hello(uint16_t sequence, char *rest) {
  session = (uint32_t)strtoul(rest, NULL, 10);
  vent(READY);
  begin_answer(sequence, 'H');
  put_text(" 1 ");
  put_text(bench->name);
  put(' ');
  put_unsigned(bench->input_count);
  put(' ');
  put_unsigned(bench->output_count);
  put(' ');
  put_unsigned(bench->silence_ms);
}

static void describe(uint16_t sequence, char kind, char *rest) {
  uint32_t k = (uint32_t)strtoul(rest, NULL, 10);
  if (k >= (kind == 'I' ? bench->input_count : bench->output_count)) {
    refuse(sequence, "channel");
    return;
  }
  begin_answer(sequence, kind);
  put(' ');
  if (kind == 'I') {
    const pliant_input *input = &bench->inputs[k];
    put_text(input->name);
    put_field(input->rest);
    put_field(input->low);
    put_field(input->high);
    put_field(input->rate > 0 ? input->rate : INFINITY);
  } else {
    const pliant_output *output = &bench->outputs[k];
    put_text(output->name);
    put_field(output->low);
    put_field(output->high);
  }
}

static void tell_values(void) {
  put(' ');
  put_unsigned(pliant_millis());
  for (uint8_t k = 0; k < bench->input_count; k++) put_field(valve[k]);
  for (uint8_t k = 0; k < bench->output_count; k++) put_field(pliant_read_sensor(k));
}

/* A straight line to the target in this time, or as fast as the rate allows. */
static void move_to(uint8_t k, float value, float seconds) {
  float most = bench->inputs[k].rate > 0 ? bench->inputs[k].rate : INFINITY;
  float wanted = seconds > 0 ? fabsf(value - valve[k]) / seconds : INFINITY;
  target[k] = value;
  speed[k] = wanted < most ? wanted : most;
}

static void exchange(uint16_t sequence, char *rest) {
  float value[PLIANT_MAX_INPUTS];
  float seconds = (float)strtoul(rest, &rest, 10) * 1e-3f;
  if (state == NEW || state == SILENT) {
    refuse(sequence, state == NEW ? "hello" : "silence");
    return;
  }
  for (uint8_t k = 0; k < bench->input_count; k++) {
    char *end;
    value[k] = (float)strtod(rest, &end);
    if (end == rest || isnan(value[k])) {
      refuse(sequence, "values");
      return;
    }
    if (value[k] < bench->inputs[k].low || value[k] > bench->inputs[k].high) {
      refuse(sequence, "range");
      return;
    }
    rest = end;
  }
  if (*rest) {
    refuse(sequence, "values");
    return;
  }
  for (uint8_t k = 0; k < bench->input_count; k++) move_to(k, value[k], seconds);
  state = ACTIVE;
  begin_answer(sequence, 'X');
  tell_values();
}

static void status(uint16_t sequence) {
  begin_answer(sequence, 'S');
  put(' ');
  put_unsigned(state);
  tell_values();
}

/* A line that is damaged, doubled or late is not answered: the computer asks again, with the next number. */
static void handle_line(void) {
  char *end, *star = memchr(line, '*', line_length);
  if (!star || strtoul(star + 1, &end, 16) != crc32(line, (uint8_t)(star - line)) || end - star != 9) return;
  *star = 0;
  uint16_t sequence = (uint16_t)strtoul(line, &end, 10);
  if (*end != ' ' || !end[1]) return;
  char kind = end[1], *rest = end + 2;
  uint8_t is_new_session = kind == 'H' && (state == NEW || (uint32_t)strtoul(rest, NULL, 10) != session);
  if (!is_new_session && state != NEW && (int16_t)(sequence - last_sequence) <= 0) return;
  last_sequence = sequence;
  heard_ms = pliant_millis();
  if (kind == 'X') exchange(sequence, rest);
  else if (kind == 'H') hello(sequence, rest);
  else if (kind == 'S') status(sequence);
  else if (kind == 'I' || kind == 'O') describe(sequence, kind, rest);
  else if (kind == 'V') {
    vent(state == NEW ? NEW : READY);
    begin_answer(sequence, 'V');
    put(' ');
    put_unsigned(pliant_millis());
  } else refuse(sequence, "request");
  send_answer();
}

void pliant_setup(const pliant_bench *given) {
  bench = given;
  line_length = line_too_long = 0;
  moved_ms = heard_ms = pliant_millis();
  vent(NEW);
}

void pliant_loop(void) {
  uint32_t now = pliant_millis(); /* every line that came before this time is read below, however long that takes */
  int byte;
  move_valves(); /* before a line is answered, which tells where they are */
  while ((byte = pliant_serial_read()) >= 0) {
    if (byte == '\n') {
      line[line_length] = 0;
      if (!line_too_long) handle_line();
      line_length = line_too_long = 0;
    } else if (line_length < LINE_SIZE - 1) {
      line[line_length++] = (char)byte;
    } else {
      line_too_long = 1;
    }
  }
  if (state == ACTIVE && (int32_t)(now - heard_ms) > (int32_t)bench->silence_ms) vent(SILENT);
}
