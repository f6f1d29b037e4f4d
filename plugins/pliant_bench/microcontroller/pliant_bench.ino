// Reference sketch: a pressure regulator on a PWM pin with an RC filter, and a potentiometer as the angle sensor.
// Put it into one folder with pliant_bench.h and pliant_bench.c. Change the constants to your wiring.

#include "pliant_bench.h"

const int VALVE_PIN = 9;                  // PWM → 10 kΩ, 1 µF → amplifier 5 V → 10 V → input of the regulator
const float PA_AT_FULL_SCALE = 100000.0;  // pressure of the regulator at the full command
const int ANGLE_PIN = A0;
const float RAD_PER_VOLT = 1.0472, VOLT_AT_ZERO = 2.5;  // of the angle sensor: measure both

const pliant_input INPUTS[] = {{"pressure_pa", 0.0, 0.0, 15000.0, 20000.0}};  // rest, low, high, per second
const pliant_output OUTPUTS[] = {{"angle_rad", -2.6, 2.6}};
const pliant_bench BENCH = {"finger", INPUTS, 1, OUTPUTS, 1, 500};

float pliant_read_sensor(uint8_t) {
  return (analogRead(ANGLE_PIN) * (5.0 / 1023.0) - VOLT_AT_ZERO) * RAD_PER_VOLT;
}

void pliant_write_valve(uint8_t, float pressure_pa) {
  analogWrite(VALVE_PIN, (int)(pressure_pa / PA_AT_FULL_SCALE * 255.0 + 0.5));
}

uint32_t pliant_millis() { return millis(); }
int pliant_serial_read() { return Serial.read(); }
void pliant_serial_write(uint8_t byte) { Serial.write(byte); }

void setup() {
  Serial.begin(115200);
  pinMode(VALVE_PIN, OUTPUT);
#if defined(__AVR_ATmega328P__)
  TCCR1B = (TCCR1B & 0xF8) | 1;  // PWM of 31 kHz on pins 9 and 10: a ripple of 4 mV behind the filter
#endif
  pliant_setup(&BENCH);
}

void loop() { pliant_loop(); }
