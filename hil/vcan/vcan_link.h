/* Makes network interfaces as `ip link` does, for a guest that has no such program. */
#ifndef GUSTFORM_VCAN_LINK_H
#define GUSTFORM_VCAN_LINK_H

/* Adds the virtual CAN interface `name` with room for CAN FD frames. 0, or -1 with errno set. */
int link_add_vcan(const char *name);

/* Switches the interface `name` on. 0, or -1 with errno set. */
int link_up(const char *name);

#endif
