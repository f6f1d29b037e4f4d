/* A bench for Pliant on a microcontroller: valves that follow lines, sensors that are read, limits of its own.
 *
 * Portable C99 without malloc and without printf of floats; about 0.7 KiB of RAM. The line protocol is described in
 * docs/connect_your_bench.md. You state the channels and write the five functions of the hardware below; call
 * pliant_setup once and pliant_loop as often as possible.
 *
 * The valves are vented, all at once, when no line has come for `silence_ms`, so that a computer that hangs, is unplugged
 * or is switched off leaves no pressure behind. A value outside the range is refused. A valve moves
 * to its command in a straight line, within the time that the computer states and never faster than the rate; venting
 * does not wait for the rate. */

#ifndef PLIANT_BENCH_H
#define PLIANT_BENCH_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PLIANT_MAX_INPUTS 4

typedef struct {
  const char *name;  /* as in measurement files, with the SI unit at its end: "pressure_pa" */
  float rest;        /* value when vented */
  float low, high;   /* range of the value */
  float rate;        /* largest change per second; 0 for no limit */
} pliant_input;

typedef struct {
  const char *name;  /* "angle_rad" */
  float low, high;   /* range that the sensor can read */
} pliant_output;

typedef struct {
  const char *name;  /* of the bench, one word */
  const pliant_input *inputs;
  uint8_t input_count;
  const pliant_output *outputs;
  uint8_t output_count;
  uint16_t silence_ms;  /* without a line for this long the valves are vented */
} pliant_bench;

/* The hardware: you write these five. */
float pliant_read_sensor(uint8_t output);              /* SI; NAN without a reading */
void pliant_write_valve(uint8_t input, float value);   /* SI */
uint32_t pliant_millis(void);                          /* milliseconds since the start */
int pliant_serial_read(void);                          /* the next byte that came, or -1 */
void pliant_serial_write(uint8_t byte);

void pliant_setup(const pliant_bench *bench);
void pliant_loop(void);

#ifdef __cplusplus
}
#endif

#endif
