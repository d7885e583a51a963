/* The loop of topdown.prove.engine over flat states, by tables that Python fills when they are asked.

   A state is `width` small numbers, one for each slot; slot 0 is NOTHING in a state that is wrong by
   itself, and slot 1 its text then. A site reads up to three slots; what they hold is the key of a
   row: what may happen there. A function is a table from the number in a slot to another. A run
   returns where a row or a number is missing, and is called again when Python has given it; a state
   is noted only when all that may happen in it is known, so nothing of it is done twice. The layouts
   of rows and steps stand in flat.py. */

#define _DEFAULT_SOURCE
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum { DONE, PAUSE, NEED_ROW, NEED_NUMBER, FOUND, NO_MEMORY };
enum { IS_DEADLOCK, IS_WRONG };
enum { TAKEN, SET, COPY, MAP, ONLY_IF, IS_BAD, NEVER };                               /* steps of a move */
enum { FAIR = 1, FAULT = 2, IF_FAULTS = 4, IF_CHANGED = 8, IF_ROOM = 16, PAYS = 32 };   /* of a move */
enum { IF_FILLED = 1, SITE_IF_FAULTS = 2, MAY_BE_WRONG = 4 };                     /* of a site */
enum { GOOD = 1, DEAD = 2 };

#define NOTHING 0xFFFF /* also: any number of faults */
#define UNKNOWN INT32_MIN
#define KEYS 3
#define LOOK_AT_CLOCK 1024 /* as in engine.py */

typedef struct {
    int32_t slots, slot[KEYS], flags;
    int32_t *rows; /* by the number in its one slot, or by places of keys */
    uint64_t *keys;
    int64_t room, used;
} site;

typedef struct {
    int32_t *numbers;
    int64_t room;
} function;

typedef struct {
    /* read by Python, in this order */
    int64_t states, looked, edges, number;
    int32_t site, function, kind, text;
    int32_t key[KEYS];
    int32_t width, pitch, padding;
    uint16_t *state;
    uint32_t *parent;
    uint8_t *taken;
    /* its own */
    int32_t faults, sites, functions, first_pause;
    site *at;
    function *map;
    int32_t *code;
    int64_t code_used, code_room;
    int32_t *rest, *wrong;
    uint64_t *table;
    uint64_t mask;
    int64_t state_room, fair_used, fair_room, taken_room;
    uint32_t *fair;
    uint16_t *fairs; /* how many fair moves of each state */
    uint8_t *mark;
    uint16_t *next;
    uint8_t *next_flags;
    uint32_t *hash;
    int64_t next_room;
} explorer;

/* Ask for large pages: most of the time goes into looking places of the tables up. Where there are
   none it is as slow as without. */
static void in_large_pages(void *what, uint64_t size) {
#ifdef MADV_HUGEPAGE
    uintptr_t page = 1 << 21, first = ((uintptr_t)what + page - 1) & ~(page - 1);
    if (size > 4 * page) (void)madvise((void *)first, size - (first - (uintptr_t)what), MADV_HUGEPAGE);
#else
    (void)what, (void)size;
#endif
}

static int grow(void **what, int64_t *room, int64_t need, size_t size, int fill) {
    if (need <= *room) return 1;
    int64_t more = *room ? *room : 64;
    while (more < need) more *= 2;
    char *new = realloc(*what, (size_t)more * size);
    if (!new) return 0;
    if (fill >= 0) memset(new + (size_t)*room * size, fill, (size_t)(more - *room) * size);
    *what = new;
    *room = more;
    return 1;
}

static uint32_t hashed(const uint16_t *state, int32_t pitch) {
    uint64_t h = 0x9E3779B97F4A7C15ull;
    for (int32_t i = 0; i < pitch; i += 4) {
        uint64_t word;
        memcpy(&word, state + i, 8);
        h = (h ^ word) * 0xD6E8FEB86659FD93ull;
        h ^= h >> 32;
    }
    h *= 0xD6E8FEB86659FD93ull;
    return (uint32_t)(h >> 32);
}

static void copy(uint16_t *to, const uint16_t *from, int32_t pitch) {
    for (int32_t i = 0; i < pitch; i += 4) memcpy(to + i, from + i, 8);
}

static int same(const uint16_t *one, const uint16_t *other, int32_t pitch) {
    uint64_t differ = 0, a, b;
    for (int32_t i = 0; i < pitch; i += 4) {
        memcpy(&a, one + i, 8);
        memcpy(&b, other + i, 8);
        differ |= a ^ b;
    }
    return !differ;
}

/* --- tables that Python fills --- */

static uint64_t place_of(const site *one, uint64_t key) {
    uint64_t place = (key * 0x9E3779B97F4A7C15ull) >> 20;
    for (;; place++) {
        place &= (uint64_t)one->room - 1;
        if (one->rows[place] < 0 || one->keys[place] == key) return place;
    }
}

static uint64_t key_of(const site *one, const int32_t *values) {
    uint64_t key = 0;
    for (int32_t i = 0; i < one->slots; i++) key |= (uint64_t)values[i] << (16 * i);
    return key;
}

static int32_t row_at(explorer *e, int32_t number, const uint16_t *state) {
    site *one = &e->at[number];
    int32_t row = -1;
    if (one->slots <= 1) {
        int32_t value = one->slots ? state[one->slot[0]] : 0;
        if (value < one->room) row = one->rows[value];
    } else if (one->room) {
        uint64_t key = 0;
        for (int32_t i = 0; i < one->slots; i++) key |= (uint64_t)state[one->slot[i]] << (16 * i);
        row = one->rows[place_of(one, key)];
    }
    if (row < 0) {
        e->site = number;
        for (int32_t i = 0; i < one->slots; i++) e->key[i] = state[one->slot[i]];
    }
    return row;
}

int explorer_row(explorer *e, int32_t number, const int32_t *values, const int32_t *code, int64_t size) {
    site *one = &e->at[number];
    if (e->code_used + size > INT32_MAX) return 0;
    if (!grow((void **)&e->code, &e->code_room, e->code_used + size, 4, -1)) return 0;
    memcpy(e->code + e->code_used, code, (size_t)size * 4);
    if (one->slots <= 1) {
        int32_t value = one->slots ? values[0] : 0;
        if (!grow((void **)&one->rows, &one->room, value + 1, 4, 0xFF)) return 0;
        one->rows[value] = (int32_t)e->code_used;
    } else {
        if (2 * (one->used + 1) > one->room) {
            site old = *one;
            one->room = old.room ? 2 * old.room : 64;
            one->rows = malloc((size_t)one->room * 4);
            one->keys = malloc((size_t)one->room * 8);
            if (!one->rows || !one->keys) return 0;
            memset(one->rows, 0xFF, (size_t)one->room * 4);
            for (int64_t i = 0; i < old.room; i++)
                if (old.rows[i] >= 0) {
                    uint64_t place = place_of(one, old.keys[i]);
                    one->rows[place] = old.rows[i];
                    one->keys[place] = old.keys[i];
                }
            free(old.rows);
            free(old.keys);
        }
        uint64_t key = key_of(one, values), place = place_of(one, key);
        one->used += one->rows[place] < 0;
        one->rows[place] = (int32_t)e->code_used;
        one->keys[place] = key;
    }
    e->code_used += size;
    return 1;
}

int explorer_number(explorer *e, int32_t number, int32_t value, int32_t result) {
    function *one = &e->map[number];
    int64_t before = one->room;
    if (!grow((void **)&one->numbers, &one->room, value + 1, 4, -1)) return 0;
    for (int64_t i = before; i < one->room; i++) one->numbers[i] = UNKNOWN;
    one->numbers[value] = result;
    return 1;
}

int explorer_functions(explorer *e, int32_t count) {
    int64_t room = e->functions;
    if (count <= room) return 1;
    if (!grow((void **)&e->map, &room, count, sizeof(function), 0)) return 0;
    e->functions = (int32_t)room;
    return 1;
}

static int32_t number_of(explorer *e, int32_t number, uint16_t value) {
    const function *one = &e->map[number];
    int32_t found = value < one->room ? one->numbers[value] : UNKNOWN;
    if (found == UNKNOWN) {
        e->function = number;
        e->key[0] = value;
    }
    return found;
}

/* --- what holds in a state: 1, 0, or UNKNOWN --- */

/* All of `count` conditions; each is a run of (begins, slot, function) of which one must hold. */
static int32_t all_hold(explorer *e, const uint16_t *state, const int32_t *steps, int32_t count) {
    int32_t any = 1;
    for (int32_t i = 0; i < count; i++, steps += 3) {
        if (steps[0]) {
            if (!any) return 0;
            any = 0;
        }
        if (!any) {
            any = number_of(e, steps[2], state[steps[1]]);
            if (any == UNKNOWN) return UNKNOWN;
        }
    }
    return any != 0;
}

/* `program`: how many alternatives, then of each a text, a count and its conditions. */
static int32_t one_holds(explorer *e, const uint16_t *state, const int32_t *program, int32_t *text) {
    int32_t many = *program++;
    for (int32_t i = 0; i < many; i++) {
        int32_t held = all_hold(e, state, program + 2, program[1]);
        if (held) {
            *text = program[0];
            return held;
        }
        program += 2 + 3 * program[1];
    }
    return 0;
}

/* --- one state --- */

static int goes_wrong(const explorer *e, uint16_t *there, int32_t text) {
    memset(there, 0, (size_t)e->pitch * 2);
    there[0] = NOTHING;
    there[1] = (uint16_t)text;
    return 1;
}

/* Carry out a move; 1 where it happens, 0 where not, UNKNOWN where a number is missing. */
static int32_t moved(explorer *e, const uint16_t *here, uint16_t *there, const int32_t *move) {
    int32_t flags = move[0], count = move[1], number;
    int bad = 0;
    const int32_t *step = move + 2, *end = step + 3 * count;
    for (; step < end && step[0] == ONLY_IF; step += 3) { /* most moves do not happen: copy later */
        number = number_of(e, step[2], here[step[1]]);
        if (number == UNKNOWN || !number) return number;
    }
    copy(there, here, e->pitch);
    for (; step < end && !bad; step += 3) switch (step[0]) {
            case TAKEN:
                e->taken[step[1]] = 1;
                break;
            case SET:
                there[step[1]] = (uint16_t)step[2];
                break;
            case COPY:
                there[step[1]] = there[step[2]];
                break;
            case MAP:
                number = number_of(e, step[2], there[step[1]]);
                if (number == UNKNOWN) return UNKNOWN;
                if (number < 0 && flags & IF_ROOM) return 0;
                if (number < 0) bad = goes_wrong(e, there, -number - 1);
                else there[step[1]] = (uint16_t)number;
                break;
            case IS_BAD:
                bad = goes_wrong(e, there, step[1]);
                break;
            case NEVER:
                number = all_hold(e, there, step + 3, step[2]);
                if (number == UNKNOWN) return UNKNOWN;
                if (number) bad = goes_wrong(e, there, step[1]);
                else step += 3 * step[2];
        }
    if (flags & IF_CHANGED && same(here, there, e->pitch)) return 0;
    if (flags & PAYS && !bad && there[e->faults] && there[e->faults] != NOTHING) there[e->faults]--;
    return 1;
}

/* All successors into `next`: how many; or the negative of a status. */
static int64_t expanded(explorer *e, const uint16_t *here, int *only_faults) {
    int64_t count = 0;
    int faulty = e->faults >= 0 && here[e->faults];
    *only_faults = 1;
    for (int32_t number = 0; number < e->sites; number++) {
        const site *one = &e->at[number];
        if (one->flags & SITE_IF_FAULTS && !faulty) continue;
        if (one->flags & IF_FILLED && !here[one->slot[0]]) continue;
        int32_t row = row_at(e, number, here);
        if (row < 0) return -NEED_ROW;
        const int32_t *move = e->code + row + 2;
        for (int32_t left = move[-1]; left; left--, move += 2 + 3 * move[1]) {
            if (move[0] & IF_FAULTS && !faulty) continue;
            if (count >= e->next_room) {
                int64_t room = e->next_room, same = room, other = room;
                if (!grow((void **)&e->next, &room, count + 1, (size_t)e->pitch * 2, -1)) return -NO_MEMORY;
                if (!grow((void **)&e->next_flags, &same, count + 1, 1, -1)) return -NO_MEMORY;
                if (!grow((void **)&e->hash, &other, count + 1, 4, -1)) return -NO_MEMORY;
                e->next_room = room;
            }
            int32_t happens = moved(e, here, e->next + count * e->pitch, move);
            if (happens == UNKNOWN) return -NEED_NUMBER;
            if (!happens) continue;
            e->next_flags[count++] = (uint8_t)move[0];
            *only_faults &= (move[0] & FAULT) != 0;
        }
    }
    return count;
}

static int make_room(explorer *e) {
    if (e->states + e->next_room >= e->state_room) {
        int64_t need = e->states + e->next_room + 1, one = e->state_room, two = one, three = one, four = one;
        if (need >= UINT32_MAX) return 0;
        if (!grow((void **)&e->state, &one, need, (size_t)e->pitch * 2, -1)) return 0;
        if (!grow((void **)&e->parent, &two, need, 4, -1)) return 0;
        if (!grow((void **)&e->fairs, &three, need, 2, -1)) return 0;
        if (!grow((void **)&e->mark, &four, need, 1, 0)) return 0;
        e->state_room = one;
    }
    if (!grow((void **)&e->fair, &e->fair_room, e->fair_used + e->next_room, 4, -1)) return 0;
    if (5 * (uint64_t)(e->states + e->next_room) > 3 * (e->mask + 1)) {
        uint64_t room = 2 * (e->mask + 1), *new = calloc(room, 8);
        if (!new) return 0;
        in_large_pages(new, 8 * room);
        for (uint64_t i = 0; i <= e->mask; i++)
            if (e->table[i]) {
                uint64_t place = e->table[i] >> 32;
                while (new[place & (room - 1)]) place++;
                new[place & (room - 1)] = e->table[i];
            }
        free(e->table);
        e->table = new;
        e->mask = room - 1;
    }
    return 1;
}

/* The number of a state, which is noted if it is new. */
static uint32_t numbered(explorer *e, const uint16_t *state, uint32_t hash, uint32_t from) {
    for (uint64_t place = hash & e->mask;; place = (place + 1) & e->mask) {
        uint64_t entry = e->table[place];
        if (!entry) {
            uint32_t number = (uint32_t)e->states++;
            e->table[place] = (uint64_t)hash << 32 | (number + 1);
            copy(e->state + (int64_t)number * e->pitch, state, e->pitch);
            e->parent[number] = from;
            return number;
        }
        if (entry >> 32 == hash) {
            uint32_t number = (uint32_t)entry - 1;
            if (same(e->state + (int64_t)number * e->pitch, state, e->pitch)) return number;
        }
    }
}

/* Memory is slow: ask for all places of the table, then for all states there, before any is read. */
static void note_all(explorer *e, int64_t count) {
    uint32_t here = (uint32_t)e->looked;
    int64_t first = e->fair_used;
    for (int64_t i = 0; i < count; i++) {
        e->hash[i] = hashed(e->next + i * e->pitch, e->pitch);
        __builtin_prefetch(e->table + (e->hash[i] & e->mask));
    }
    for (int64_t i = 0; i < count; i++)
        for (uint64_t place = e->hash[i] & e->mask; e->table[place]; place = (place + 1) & e->mask)
            if (e->table[place] >> 32 == e->hash[i]) {
                __builtin_prefetch(e->state + (int64_t)((uint32_t)e->table[place] - 1) * e->pitch);
                break;
            }
    for (int64_t i = 0; i < count; i++) {
        uint32_t number = numbered(e, e->next + i * e->pitch, e->hash[i], here);
        if ((e->next_flags[i] & (FAIR | FAULT)) == FAIR) e->fair[e->fair_used++] = number;
    }
    e->edges += count;
    e->fairs[here] = (uint16_t)(e->fair_used - first);
}

static int found(explorer *e, int32_t kind, int32_t text) {
    e->kind = kind;
    e->text = text;
    e->number = e->looked++;
    return FOUND;
}

/* Look at the next state. DONE: it is looked at. */
static int look(explorer *e) {
    const uint16_t *here = e->state + e->looked * e->pitch;
    int32_t text = 0, held;
    int only_faults = 1;
    e->fairs[e->looked] = 0;
    if (here[0] == NOTHING) {
        e->mark[e->looked] = GOOD;
        return found(e, IS_WRONG, here[1]);
    }
    held = one_holds(e, here, e->wrong, &text);
    for (int32_t number = 0; number < e->sites && !held; number++) {
        if (!(e->at[number].flags & MAY_BE_WRONG) || !here[e->at[number].slot[0]]) continue;
        int32_t row = row_at(e, number, here);
        if (row < 0) return NEED_ROW;
        text = e->code[row];
        held = text >= 0;
    }
    if (held == UNKNOWN) return NEED_NUMBER;
    if (held) {
        e->mark[e->looked] = GOOD;
        return found(e, IS_WRONG, text);
    }
    int32_t rests = one_holds(e, here, e->rest, &text);
    if (rests == UNKNOWN) return NEED_NUMBER;
    int64_t count = expanded(e, here, &only_faults);
    if (count < 0) return (int)-count;
    if (count >= NOTHING || !make_room(e)) return NO_MEMORY;
    if (rests) e->mark[e->looked] = GOOD;
    if (!rests && only_faults) {
        e->mark[e->looked] = DEAD;
        return found(e, IS_DEADLOCK, -1);
    }
    note_all(e, count);
    e->looked++;
    return DONE;
}

/* Breadth first until nothing is left, the clock is to be looked at, or Python is needed. */
int explorer_run(explorer *e) {
    while (e->looked < e->states) {
        if (e->looked % LOOK_AT_CLOCK == 0 && e->first_pause != e->looked / LOOK_AT_CLOCK + 1) {
            e->first_pause = (int32_t)(e->looked / LOOK_AT_CLOCK + 1);
            return PAUSE;
        }
        int status = look(e);
        if (status != DONE) return status;
    }
    return DONE;
}

/* The first state from which fair moves lead neither to rest nor to one not looked at; -1: none. A
   state is good if a fair move leads to a good one, until nothing changes; backwards, since rest is
   mostly among the older ones. */
int64_t explorer_stuck(explorer *e) {
    int changed = 1, backwards = 1;
    for (int64_t i = e->looked; i < e->states; i++) e->mark[i] = GOOD;
    for (; changed; backwards = !backwards) {
        changed = 0;
        int64_t at = backwards ? e->fair_used : 0;
        for (int64_t i = 0; i < e->looked; i++) {
            int64_t here = backwards ? e->looked - 1 - i : i;
            if (backwards) at -= e->fairs[here];
            if (!(e->mark[here] & GOOD))
                for (int64_t k = 0; k < e->fairs[here]; k++)
                    if (e->mark[e->fair[at + k]] & GOOD) {
                        e->mark[here] |= GOOD;
                        changed = 1;
                        break;
                    }
            if (!backwards) at += e->fairs[here];
        }
    }
    for (int64_t i = 0; i < e->looked; i++)
        if (!e->mark[i]) return i;
    return -1;
}

void explorer_end(explorer *e) {
    for (int32_t i = 0; i < e->sites; i++) {
        free(e->at[i].rows);
        free(e->at[i].keys);
    }
    for (int32_t i = 0; i < e->functions; i++) free(e->map[i].numbers);
    void *parts[] = {e->at,    e->map,  e->code,  e->rest, e->wrong, e->table,      e->state, e->parent,
                     e->taken, e->fair, e->fairs, e->mark, e->next,  e->next_flags, e->hash,  e};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) free(parts[i]);
}

/* `sites`: of each how many slots it reads, which three, its flags. `rest`, `wrong`: see one_holds.
   `faults`: the slot of the faults that may still come, or -1. */
explorer *explorer_new(int32_t width, const uint16_t *first, int32_t faults, int32_t sites,
                       const int32_t *site_table, const int32_t *rest, int32_t rest_size,
                       const int32_t *wrong, int32_t wrong_size, int32_t taken) {
    explorer *e = calloc(1, sizeof *e);
    if (!e) return NULL;
    e->width = width;
    e->pitch = (width + 3) / 4 * 4;
    e->faults = faults;
    e->sites = sites;
    e->at = calloc((size_t)sites + 1, sizeof *e->at);
    e->rest = malloc((size_t)rest_size * 4);
    e->wrong = malloc((size_t)wrong_size * 4);
    e->taken = calloc((size_t)taken + 1, 1);
    e->mask = 1023;
    e->table = calloc(e->mask + 1, 8);
    uint16_t *start = calloc((size_t)e->pitch, 2);
    int whole = e->at && e->rest && e->wrong && e->taken && e->table && start;
    e->sites = e->at ? sites : 0;
    if (whole) {
        for (int32_t i = 0; i < sites; i++, site_table += KEYS + 2) {
            e->at[i].slots = site_table[0];
            memcpy(e->at[i].slot, site_table + 1, sizeof e->at[i].slot);
            e->at[i].flags = site_table[KEYS + 1];
        }
        memcpy(e->rest, rest, (size_t)rest_size * 4);
        memcpy(e->wrong, wrong, (size_t)wrong_size * 4);
        memcpy(start, first, (size_t)width * 2);
        whole = make_room(e);
    }
    if (whole) numbered(e, start, hashed(start, e->pitch), 0);
    free(start);
    if (whole) return e;
    explorer_end(e);
    return NULL;
}
