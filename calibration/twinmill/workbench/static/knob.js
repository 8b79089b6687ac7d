// SPDX-License-Identifier: Apache-2.0
// One quantity of the model: a number, and a slider over its interval. While a hand turns it the stage
// draws what comes of it; the server is told what is kept, as `keep`, and `hold` of the lock.

const REST_MS = 300; // after a key, before what it moved is a model

/** Six digits, as a model file has them. */
const worded = (value) => String(Number(Number(value).toPrecision(6)));

export default {
  props: [
    "name", "label", "words", "unit", "value", "low", "high", "least", "most", "step", "interval", "fitted",
    "held", "drawn",
  ],

  template: `
    <div class="knob">
      <div class="line">
        <q-icon v-if="fitted" :name="held ? 'lock' : 'lock_open'" :class="['lock', { held }]" role="button"
          tabindex="0" :aria-label="'Hold ' + name" :aria-pressed="String(held)" @click="$emit('hold')"
          @keydown.enter="$emit('hold')" @keydown.space.prevent="$emit('hold')" />
        <span class="what" :title="words">{{ label }}</span>
        <input class="number" inputmode="decimal" v-model="typed" :aria-label="name"
          @input="typing = true" @keydown.enter="type" @keydown.esc="leave" @blur="type">
        <span class="unit">{{ unit }}</span>
      </div>
      <div class="reach">
        <div v-if="interval" class="interval" :style="stretch"></div>
        <q-slider dense thumb-size="14px" track-size="3px" color="blue-9" :aria-label="name"
          :min="low" :max="high" :step="step" :model-value="at" @update:model-value="turn"
          @change="keep" @pan="turning = $event === 'start'" />
      </div>
    </div>`,

  data() {
    return { at: this.value, typed: worded(this.value), typing: false, turning: false };
  },

  watch: {
    // The server has drawn the model anew: what is half typed or under a hand is not taken away.
    drawn() {
      if (!this.turning) this.at = this.value;
      if (!this.typing) this.typed = worded(this.value);
    },
  },

  computed: {
    stretch() {
      const wide = this.high - this.low || 1;
      const [left, right] = this.interval.map((v) => Math.min(Math.max((v - this.low) / wide, 0), 1));
      return { left: `${100 * left}%`, width: `${Math.max(100 * (right - left), 0.8)}%` };
    },
  },

  methods: {
    turn(value) {
      this.at = value;
      this.typed = worded(value);
      window.twinmill.turn(this.name, value);
    },

    /** Once keys rest, and the last move was drawn: nothing of it comes to the server later. */
    keep(value) {
      clearTimeout(this.due);
      this.due = setTimeout(async () => {
        await window.twinmill.predicted();
        this.$emit("keep", value);
      }, REST_MS);
    },

    type() {
      if (!this.typing) return;
      this.typing = false;
      const value = Number(this.typed.trim().replace(",", "."));
      if (!this.typed.trim() || Number.isNaN(value) || worded(value) === worded(this.value)) return this.leave();
      this.at = Math.min(Math.max(value, this.least), this.most);
      this.typed = worded(this.at);
      this.$emit("keep", value);
    },

    leave() {
      this.typing = false;
      this.typed = worded(this.value);
    },
  },
};
