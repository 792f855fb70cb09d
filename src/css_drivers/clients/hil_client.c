/* SPDX-License-Identifier: Apache-2.0
 * A board for ./sunpoint hil in one page: reads sensors, finds the Sun, points the arrays of mission okeefe_2013.
 *   cc -std=c11 -Wall -Wextra -Wpedantic -Werror hil_client.c -lm -o hil_client
 *   ./hil_client udp 47000      or      ./hil_client /dev/ttyGS0 */
#define _DEFAULT_SOURCE
#include <arpa/inet.h>
#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "hil_frame.h"

#define A 0.70710678f
static const float NORMAL[8][3] = {{A, 0, A}, {0, A, A}, {-A, 0, A}, {0, -A, A},
                                   {A, 0, -A}, {0, A, -A}, {-A, 0, -A}, {0, -A, -A}};
static const float WHEEL[4][3] = {{0, A, A}, {0, A, -A}, {A, -A, 0}, {-A, -A, 0}};
static const float SHARE[3] = {1.0f, 0.5f, 1.0f}; /* inverse of the sum of WHEEL WHEEL^T, which is diagonal */
static const float STIFFNESS = 0.03f, DAMPING = 0.7f, MOST = 0.03f; /* N m, N m s, N m */

static uint32_t crc32(const uint8_t *bytes, size_t count) {
  uint32_t crc = 0xFFFFFFFFu;
  for (size_t i = 0; i < count; i++) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

static uint16_t u16(const uint8_t *at) { return (uint16_t)(at[0] | at[1] << 8); }
static uint32_t u32(const uint8_t *at) { return (uint32_t)u16(at) | (uint32_t)u16(at + 2) << 16; }
static void put_u32(uint8_t *at, uint32_t v) { for (int i = 0; i < 4; i++) at[i] = (uint8_t)(v >> 8 * i); }
static float f32(const uint8_t *at) { uint32_t v = u32(at); float f; memcpy(&f, &v, 4); return f; }
static void put_f32(uint8_t *at, float f) { uint32_t v; memcpy(&v, &f, 4); put_u32(at, v); }

/* Answers the sensors in a payload: the command's payload, and its length. */
static uint16_t control(const uint8_t *in, uint8_t *out) {
  const unsigned cells = in[HIL_SENSORS_CELLS_AT], wheels = in[HIL_SENSORS_WHEELS_AT], rods = in[HIL_SENSORS_RODS_AT];
  float sun[3] = {0, 0, 0}, rate[3], torque[3];
  for (unsigned i = 0; i < cells && i < 8; i++) {
    const float v = f32(in + HIL_SENSORS_CELL_AT + 4 * i);
    for (int k = 0; k < 3; k++) sun[k] += v > 0.1f ? v * NORMAL[i][k] : 0.0f; /* NaN is not above 0.1 either */
  }
  const float length = sqrtf(sun[0] * sun[0] + sun[1] * sun[1] + sun[2] * sun[2]);
  const int seen = length > 0.2f, turns = in[HIL_SENSORS_FLAGS_AT] & HIL_HAS_GYRO;
  for (int k = 0; k < 3; k++) {
    sun[k] = seen ? sun[k] / length : 0.0f;
    rate[k] = turns ? f32(in + HIL_SENSORS_GYRO_AT + 4 * k) : 0.0f;
  }
  memset(out, 0, HIL_COMMAND_BYTES(wheels, rods));
  out[HIL_COMMAND_FLAGS_AT] = seen ? HIL_HAS_SUN : 0;
  out[HIL_COMMAND_WHEELS_AT] = (uint8_t)wheels;
  out[HIL_COMMAND_RODS_AT] = (uint8_t)rods;
  torque[0] = -STIFFNESS * sun[1] - DAMPING * rate[0]; /* z cross Sun turns the normal z of the arrays to the Sun */
  torque[1] = STIFFNESS * sun[0] - DAMPING * rate[1];
  torque[2] = -DAMPING * rate[2];
  for (int k = 0; k < 3; k++) put_f32(out + HIL_COMMAND_SUN_AT + 4 * k, sun[k]);
  for (unsigned i = 0; i < wheels && i < 4 && turns; i++) { /* the body feels the opposite of what the motors give */
    float motor = 0;
    for (int k = 0; k < 3; k++) motor -= WHEEL[i][k] * SHARE[k] * torque[k];
    put_f32(out + HIL_COMMAND_TORQUE_AT + 4 * i, fmaxf(-MOST, fminf(MOST, motor)));
  }
  return (uint16_t)HIL_COMMAND_BYTES(wheels, rods);
}

/* Answers the first frame in some bytes; how many of them are done with, 0 when more must come. */
static size_t answer(const uint8_t *in, size_t count, uint8_t *out, size_t *answered) {
  *answered = 0;
  if (count < HIL_HEADER_BYTES) return 0;
  const uint16_t length = u16(in + HIL_HEADER_LENGTH_AT);
  const size_t end = HIL_HEADER_BYTES + length;
  if (in[0] != HIL_SYNC0 || in[1] != HIL_SYNC1 || in[HIL_HEADER_VERSION_AT] != HIL_VERSION ||
      in[HIL_HEADER_KIND_AT] != HIL_KIND_SENSORS || length > HIL_LONGEST_PAYLOAD)
    return 1;
  if (count < end + 4) return 0;
  if (u32(in + end) != crc32(in + 2, end - 2)) return 1;
  const uint8_t *told = in + HIL_HEADER_BYTES;
  if (length != HIL_SENSORS_BYTES((unsigned)told[HIL_SENSORS_CELLS_AT], (unsigned)told[HIL_SENSORS_WHEELS_AT]) ||
      told[HIL_SENSORS_WHEELS_AT] > HIL_MOST_UNITS || told[HIL_SENSORS_RODS_AT] > HIL_MOST_UNITS)
    return 1;
  memcpy(out, in, HIL_HEADER_BYTES); /* sequence and stamp come back as they were */
  out[HIL_HEADER_KIND_AT] = HIL_KIND_COMMAND;
  const uint16_t own = control(told, out + HIL_HEADER_BYTES);
  out[HIL_HEADER_LENGTH_AT] = (uint8_t)own;
  out[HIL_HEADER_LENGTH_AT + 1] = (uint8_t)(own >> 8);
  put_u32(out + HIL_HEADER_BYTES + own, crc32(out + 2, HIL_HEADER_BYTES - 2 + own));
  *answered = HIL_HEADER_BYTES + own + 4;
  return end + 4;
}

int main(int argc, char **argv) {
  uint8_t in[4096], out[HIL_HEADER_BYTES + HIL_LONGEST_PAYLOAD + 4];
  struct sockaddr_in peer = {0};
  socklen_t size = sizeof peer;
  const int udp = argc == 3 && !strcmp(argv[1], "udp");
  if (!udp && argc != 2) return fprintf(stderr, "usage: hil_client udp PORT | DEVICE\n"), 2;
  const int file = udp ? socket(AF_INET, SOCK_DGRAM, 0) : open(argv[1], O_RDWR | O_NOCTTY);
  peer.sin_family = AF_INET;
  peer.sin_port = htons((uint16_t)(udp ? atoi(argv[2]) : 0));
  if (file < 0 || (udp && bind(file, (struct sockaddr *)&peer, sizeof peer))) return perror(argv[1]), 1;
  struct termios line;
  if (!udp && !tcgetattr(file, &line)) cfmakeraw(&line), cfsetspeed(&line, B921600), tcsetattr(file, TCSANOW, &line);
  for (size_t held = 0;;) {
    const ssize_t came = udp ? recvfrom(file, in, sizeof in, 0, (struct sockaddr *)&peer, &size)
                             : read(file, in + held, sizeof in - held);
    if (came <= 0) return 0;
    held = (udp ? 0 : held) + (size_t)came;
    size_t done, answered, at = 0;
    while ((done = answer(in + at, held - at, out, &answered)) > 0) {
      at += done;
      if (answered && (udp ? sendto(file, out, answered, 0, (struct sockaddr *)&peer, size)
                           : write(file, out, answered)) < 0) return perror("answer"), 1;
    }
    memmove(in, in + at, held -= at);
  }
}
