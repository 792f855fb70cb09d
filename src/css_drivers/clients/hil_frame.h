/* SPDX-License-Identifier: Apache-2.0
 * Frames between the simulation and a board; made by: python -m css_drivers.hil_header
 * Little endian. HIL_X_Y_AT is the place of field Y in part X, in bytes; that of the header counts from the
 * sync, those of sensors and command from the begin of their payload. A CRC-32 follows the payload. */
#ifndef HIL_FRAME_H
#define HIL_FRAME_H

#define HIL_SYNC0 0x53u
#define HIL_SYNC1 0xA7u
#define HIL_VERSION 1u
#define HIL_KIND_SENSORS 1u
#define HIL_KIND_COMMAND 2u
#define HIL_HEADER_BYTES 18u
#define HIL_LONGEST_PAYLOAD 288u
#define HIL_MOST_UNITS 32u
#define HIL_HAS_GYRO 1u
#define HIL_HAS_FIELD 2u
#define HIL_HAS_WHEELS 4u
#define HIL_HAS_SUN 1u

#define HIL_HEADER_VERSION_AT 2u /* uint8_t - */
#define HIL_HEADER_KIND_AT 3u /* uint8_t - */
#define HIL_HEADER_LENGTH_AT 4u /* uint16_t bytes */
#define HIL_HEADER_SEQUENCE_AT 6u /* uint32_t - */
#define HIL_HEADER_STAMP_AT 10u /* uint64_t ns */

#define HIL_SENSORS_FLAGS_AT 0u /* uint8_t - */
#define HIL_SENSORS_CELLS_AT 1u /* uint8_t - */
#define HIL_SENSORS_WHEELS_AT 2u /* uint8_t - */
#define HIL_SENSORS_RODS_AT 3u /* uint8_t - */
#define HIL_SENSORS_PERIOD_AT 4u /* uint32_t us */
#define HIL_SENSORS_GYRO_AT 8u /* float[3] rad/s */
#define HIL_SENSORS_FIELD_AT 20u /* float[3] T */
#define HIL_SENSORS_CELL_AT 32u /* float[cells] - */
#define HIL_SENSORS_WHEEL_SPEED_AT(cells) (32u + 4u * (cells)) /* float[wheels] rad/s */
#define HIL_SENSORS_BYTES(cells, wheels) (32u + 4u * (cells) + 4u * (wheels))

#define HIL_COMMAND_FLAGS_AT 0u /* uint8_t - */
#define HIL_COMMAND_WHEELS_AT 1u /* uint8_t - */
#define HIL_COMMAND_RODS_AT 2u /* uint8_t - */
#define HIL_COMMAND_RESERVED_AT 3u /* uint8_t - */
#define HIL_COMMAND_SUN_AT 4u /* float[3] - */
#define HIL_COMMAND_TORQUE_AT 16u /* float[wheels] N m */
#define HIL_COMMAND_DIPOLE_AT(wheels) (16u + 4u * (wheels)) /* float[rods] A m^2 */
#define HIL_COMMAND_BYTES(wheels, rods) (16u + 4u * (wheels) + 4u * (rods))

#endif
